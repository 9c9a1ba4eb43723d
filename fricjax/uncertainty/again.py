"""Fits repeated with other displacements, or with a parameter fixed."""

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..errors import UsageError, check_type
from ..fitting import Fit
from ..fitting.batch import Row, alone, solved_rows
from ..fitting.chunks import blocks
from ..fitting.problem import Problem
from ..fitting.residual import without_inputs
from ..fitting.solve import Solution, solve, solve_batch
from ..oscillator import cores, one_at_a_time
from ..show.working import working


def problem_of(fit: Fit) -> Problem:
    """Return the least-squares problem of a fit.

    Raises:
        UsageError: the fit was read from a file, or found no optimum.
    """
    check_type("fit", fit, Fit, "the Fit of fricjax.fit")
    if fit.problem is None:
        raise UsageError("This fit was read from a file, which does not hold its settings. Fit the record again.")
    if not fit.optimum_found:
        raise UsageError(f"This fit has no optimum to start from: {fit.status}")
    return fit.problem


def optimum(fit: Fit) -> np.ndarray:
    """Return the fitted values in the order of the names, shape (p,).

    Times are those of the runs.
    """
    return np.array([fit.values[name] for name in fit.names]) - problem_of(fit).origins


def fixed_at(problem: Problem, parameter: int, value: float, std: float) -> Problem:
    """Return the problem with one parameter fixed by a narrow prior.

    Without the parameter the problem would have another shape, which JAX would have to compile.

    Args:
        problem: the problem.
        parameter: number of the parameter.
        value: its value.
        std: standard deviation of the prior.
    """
    mean, weight = (np.array(each) for each in (problem.residual.prior_mean, problem.residual.prior_weight))
    mean[parameter], weight[parameter] = value, 1 / std
    priors = {"prior_mean": mean, "prior_weight": weight}
    residual, condensed = (each._replace(**priors) for each in (problem.residual, problem.condensed))
    return dataclasses.replace(problem, residual=residual, condensed=condensed)


def _of_record(problem: Problem) -> Problem:
    """Return the problem without the inputs of a rig.

    The fit itself already has their contributions.
    """
    return dataclasses.replace(problem, residual=without_inputs(problem.residual), inputs={})


def solved(make: Callable[[int], Problem], count: int, begin: np.ndarray) -> list[Row]:
    """Solve `count` problems on all cores.

    Args:
        make: returns the problem of a number; it runs in the thread that solves the problem.
        count: number of problems.
        begin: start coordinates of all problems, shape (p,).
    """

    @one_at_a_time()
    def block(place: Sequence[int]) -> list[Row]:
        return solved_rows([_of_record(make(i)) for i in place], [begin] * len(place))

    rows: list[Row] = []
    with working("Fitting records", count) as task, ThreadPoolExecutor(cores() + 1) as pool:
        for rows_of_block in pool.map(block, blocks(count)):
            rows += rows_of_block
            task.advance(len(rows_of_block))
    return rows


def squares(problems: Sequence[Problem], begins: Sequence[np.ndarray]) -> list[Solution]:
    """Return the least-squares solutions of problems, each from coordinates `begins`."""
    asked = list(map(_of_record, problems))
    if alone(asked):
        return [solve(problem, begin) for problem, begin in zip(asked, begins, strict=True)]
    return [solution for solution, _ in solve_batch(asked, begins)]
