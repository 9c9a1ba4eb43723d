"""Solve a fit on the condensed record and check all samples.

At the optimum of the condensed record all samples are evaluated once, with an engine of different numerical errors. The
Gauss-Newton step that remains there is the shift of the parameters by numerical errors, including condensation. If it
is not small against the standard errors, the fit continues with all samples and a finer engine. The smooth engine needs
a mesh for its coordinates, and gets a new one at the optimum.

All of this uses one compiled program, with other samples, meshes and schedules.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from .. import thresholds
from ..errors import UsageError
from ..estimation.covariance import Quadratic, quadratic
from ..estimation.loss import AbstractLoss, Squares
from ..estimation.status import AT_BOUND, CONVERGED, OUT_OF_STEPS, STALLED, UNDETERMINED
from ..oscillator import Program, waiting
from ..oscillator.engines import AbstractEngine
from .chunks import Member, solve_in_chunks
from .derived import Derived
from .evaluation import Evaluation
from .mesh import likely, with_mesh
from .problem import Problem
from .residual import Residual, without_inputs
from .runs import full_stage
from .stages import (
    CONTINUE,
    CONTINUE_ROBUST,
    EVALUATE_ONLY,
    ROUNDING,
    Iterate,
    Schedule,
    like_iterate,
    solve_in_stages,
    solve_on_host,
)
from .tabulate import Tables, untabulated

_BOUNDLESS = 1e100
# The first mesh, and the least-squares stage of a robust fit, only provide a start for the next stage: factor of the
# allowed error of that mesh, and tolerance of its optimum.
_ROUGH, _NEAR = 100.0, Schedule(tolerance=np.asarray(0.3))
# If a direction is undetermined, a finer engine cannot find an optimum.
_OPTIMA = (CONVERGED, AT_BOUND)
_ENDS = (*_OPTIMA, UNDETERMINED)
# A mesh fits one set of coordinates, so an optimum may need a mesh made near it. Until then the solver may run out of
# steps, or stall on an outdated mesh. It continues while chi^2 decreases by this factor.
_MESHES, _PAYS = 6, 0.8
_ON_A_MESH = (*_OPTIMA, OUT_OF_STEPS, STALLED)


class Solution(NamedTuple):
    """A solved fit.

    Attributes:
        y: coordinates of the parameters and, all zero, of the inputs of the rig.
        evaluation: evaluation of all samples there, with the engine of the check.
        derived: physical values for the coordinates.
        shape: the quadratic model of chi^2 there.
        numerical_shift: largest remaining step there in any direction, in standard errors from the scatter of the
            residuals: the largest change of a parameter by numerical errors.
        status: status of the solver.
        iterations, passes, stages: steps of Levenberg-Marquardt, evaluations of the model in total, and stages.
        rivals: other numbers of half-cycles that describe the record similarly well.
    """

    y: Float[np.ndarray, " coordinates"]
    evaluation: Evaluation
    derived: Derived
    shape: Quadratic
    numerical_shift: float
    status: int
    iterations: int
    passes: int
    stages: int
    rivals: tuple["Rival", ...] = ()

    @property
    def chi2(self) -> float:
        return float(self.evaluation.chi2)

    @property
    def predicted_chi2(self) -> float:
        """Predicted chi^2 after the next step; -inf if not finite here."""
        ahead = self.chi2 - self.shape.distance**2
        return ahead if np.isfinite(ahead) else -np.inf

    @property
    def accurate(self) -> bool:
        """True if numerical errors are small against the standard errors."""
        return self.numerical_shift <= thresholds.ACCURATE

    @property
    def converged(self) -> bool:
        return self.status in (CONVERGED, AT_BOUND, UNDETERMINED)


class Rival(NamedTuple):
    """Problem with another number of half-cycles, evaluated at the current solution."""

    problem: Problem
    solution: Solution


def half_cycles(problem: Problem) -> tuple[int, ...]:
    """Return the number of half-cycles of each run."""
    return tuple(int(run.half_cycles) for run in problem.residual.runs)


staged = Program(solve_in_stages, like_iterate)


def one_by_one(members: Sequence[Member], loss: AbstractLoss) -> list[Iterate]:
    """Return the iterate of each problem, solved separately."""
    with waiting():
        return [_solved(member, loss) for member in members]


def _solved(member: Member, loss: AbstractLoss) -> Iterate:
    """Solve one problem, by tables if its engine has them.

    Tables do not continue a motion beyond the stop of the law. A solve that this stops goes to the other engine.
    """
    arguments = member.stage_weights, member.limits, loss, np.asarray(member.y), member.schedule
    if isinstance(member.residual.engine, Tables):
        at = solve_on_host(member.residual, *arguments)
        evaluates = int(member.schedule.steps) == 1
        if np.isfinite(at.evaluation.cost) and (evaluates or at.status in _ENDS):
            return at
    return jax.tree.map(np.asarray, staged(untabulated(member.residual), *arguments))


# Outline of a fit: `solve` calls `solve_condensed`, which proceeds in stages to the optimum of few samples (`_optima`).
# Then `_refined` evaluates all samples there (`_checked`), and continues while that shifts the optimum. `solve_batch`
# does the same for many fits, except for the last step.
def solve(problem: Problem, y: Any = None) -> Solution:
    """Fit from the start values or from `y`, and check the result."""
    at = solve_condensed(problem, start_coordinates(problem) if y is None else y[: problem.condensed.n_parameters])
    meshed = problem.residual.engine.needs_mesh
    return _refined(problem, at, *((_MESHES, _ON_A_MESH) if meshed else (1, _OPTIMA)))


def solve_batch(problems: Sequence[Problem], begins: Sequence[np.ndarray] | None = None) -> list[tuple[Solution, Any]]:
    """Fit problems of one loss in chunks and check the results.

    The engines must need no mesh. No solution is refined with a finer engine, and residuals of samples are not kept.
    Their typical sizes are returned instead, overall and in motion. `begins` are initial coordinates of the problems;
    None for the start values.
    """
    if not problems:
        return []
    begins = [start_coordinates(problem) for problem in problems] if begins is None else begins
    # Tables of single fits would take longer than the solves.
    problems = [
        dataclasses.replace(p, residual=untabulated(p.residual), condensed=untabulated(p.condensed)) for p in problems
    ]
    run = lambda members, loss: [at for at, _ in solve_in_chunks(members, loss)]
    ends = _optima(problems, begins, run, Schedule())
    targets = [with_inputs(problem.residual, at.y) for problem, at in zip(problems, ends, strict=True)]
    pairs = zip(problems, targets, strict=True)
    members = [on_all_samples(p, checking(p.residual, y), y, EVALUATE_ONLY) for p, y in pairs]
    checked = zip(problems, ends, solve_in_chunks(members, problems[0].loss), strict=True)
    return [(solution_of(problem, at, evaluated), sizes) for problem, at, (evaluated, sizes) in checked]


def solve_condensed(problem: Problem, begin: Any) -> Iterate:
    """Return the optimum of the condensed record, from coordinates `begin`.

    A robust loss uses all samples.
    """
    _compile_ahead(problem, begin)
    return _optima([problem], [begin], one_by_one, _NEAR)[0]


def _compile_ahead(problem: Problem, begin: Any) -> None:
    """Start compiling the solver and the rig sensitivity program in threads."""
    wanted = []
    if problem.residual.engine.needs_mesh and (expected := likely(problem.condensed, begin)) is not None:
        wanted.append((Member(expected, problem.stage_weights, problem.limits, begin, _NEAR), Squares()))
    tabulated = isinstance(problem.residual.engine, Tables)
    if problem.residual.inputs.shape[0] and not tabulated and (expected := likely(problem.residual, begin)) is not None:
        evaluated = _with_engine(expected, expected.engine.checking())
        member = on_all_samples(problem, evaluated, with_inputs(evaluated, begin), EVALUATE_ONLY)
        wanted.append((member, problem.loss))
    for m, loss in wanted:
        args = m.residual, m.stage_weights, m.limits, loss, m.y, m.schedule
        if not staged.is_compiled(*args):
            staged.compile_beside(*args)


def _optima(
    problems: Sequence[Problem], begins: Sequence[Any], run: Callable[..., list[Iterate]], near: Schedule
) -> list[Iterate]:
    """Return the same for many problems of one engine and loss.

    A first stage that only provides a start has the schedule `near`.
    """
    meshed, robust = problems[0].residual.engine.needs_mesh, not isinstance(problems[0].loss, Squares)
    few = [with_mesh(p.condensed, y, _ROUGH) for p, y in zip(problems, begins, strict=True)]
    schedule = near if meshed or robust else Schedule()
    starts = zip(problems, few, begins, strict=True)
    ends = run([Member(r, p.stage_weights, p.limits, y, schedule) for p, r, y in starts], Squares())
    reached = list(zip(problems, few, ends, strict=True))
    if robust:
        full = [with_mesh(without_inputs(p.residual), at.y) for p, _, at in reached]
        pairs = zip(problems, full, ends, strict=True)
        further = run([on_all_samples(p, r, at.y, CONTINUE_ROBUST) for p, r, at in pairs], problems[0].loss)
    elif meshed:
        members = [Member(with_mesh(r, at.y), p.stage_weights, p.limits, at.y, Schedule()) for p, r, at in reached]
        further = run(members, Squares())
    else:
        return ends
    return [joined(at, then) for at, then in zip(ends, further, strict=True)]


def joined(first: Iterate, then: Iterate) -> Iterate:
    """Combine two iterates; the second continued from the first."""
    steps, stages = int(first.iterations) + int(then.iterations), int(first.stages) + int(then.stages)
    return then._replace(iterations=steps, stages=stages)


def on_all_samples(problem: Problem, residual: Residual, y: Any, schedule: Schedule) -> Member:
    """Return the problem of all samples of a residual, from coordinates `y`."""
    stages = tuple(full_stage(*pair) for pair in zip(problem.windows, residual.runs, strict=True))
    return Member(residual, stages, problem.limits, y, schedule)


def _refined(problem: Problem, at: Iterate, rounds: int, endings: tuple[int, ...]) -> Solution:
    """Check a fit, and continue with finer engines until it is accurate.

    Only a fit with one of the statuses `endings` continues. A stalled fit continues until chi^2 has not decreased twice
    in a row: if elements slip between the steps of a mesh, another mesh may lead to the optimum.
    """
    residual = problem.residual
    solution, before, in_vain = _checked(problem, residual, at), np.inf, 0
    for _ in range(rounds):
        in_vain = in_vain + 1 if solution.status == STALLED and not solution.chi2 < _PAYS * before else 0
        if solution.accurate or solution.status not in endings or in_vain == 2:
            break
        before = solution.chi2
        residual = _with_engine(residual, residual.engine.finer())
        try:
            target = with_mesh(without_inputs(residual), at.y)
            (then,) = one_by_one([on_all_samples(problem, target, at.y, CONTINUE)], problem.loss)
            then = joined(at, then)
            at, solution = then, _checked(problem, residual, then)
        except UsageError:
            # No mesh holds so many steps: the numerical shift reports the remaining error.
            break
    return solution


def _with_engine(residual: Residual, engine: AbstractEngine) -> Residual:
    return residual._replace(engine=engine)


def checking(residual: Residual, y: Any) -> Residual:
    """Return the residual with a verification engine, meshed at `y`."""
    return with_mesh(_with_engine(residual, residual.engine.checking()), y)


def with_inputs(residual: Residual, y: Any) -> np.ndarray:
    """Append zero coordinates of the rig inputs to those of the parameters."""
    return np.concatenate([y, np.zeros(residual.inputs.shape[0])])


def evaluate_at(problem: Problem, residual: Residual, y: Any) -> Iterate:
    """Evaluate all samples of a residual at coordinates `y`.

    They include the inputs of the rig.
    """
    (at,) = one_by_one([on_all_samples(problem, residual, y, EVALUATE_ONLY)], problem.loss)
    return at


def _checked(problem: Problem, residual: Residual, at: Iterate) -> Solution:
    y = with_inputs(residual, at.y)
    return solution_of(problem, at, evaluate_at(problem, checking(residual, y), y))


def solution_of(problem: Problem, at: Iterate, evaluated: Iterate) -> Solution:
    """Build the solution from the final iterate and an evaluation.

    `evaluated` is the evaluation of all samples there. All arrays are those of numpy.
    """
    p, evaluation = at.y.size, evaluated.evaluation
    at_bound = (at.y <= problem.limits.lower) | (at.y >= problem.limits.upper)
    shape = quadratic(evaluation.gradient[:p], evaluation.normal[:p, :p], at_bound)
    variance = max(float(evaluation.chi2), _rounding(problem)) / problem.dof
    # A motion that diverges is treated as not finite, since its squares would overflow.
    evaluation = evaluation._replace(
        residual=np.where(np.abs(evaluation.residual) < _BOUNDLESS, evaluation.residual, np.nan)
    )
    return Solution(
        y=with_inputs(problem.residual, at.y),
        evaluation=evaluation,
        derived=evaluated.derived,
        shape=shape,
        numerical_shift=shape.distance / float(np.sqrt(variance)),
        status=int(at.status),
        iterations=int(at.iterations),
        passes=int(at.iterations) + 2,
        stages=int(at.stages),
    )


def _rounding(problem: Problem) -> float:
    """Return the chi^2 of rounding errors alone."""
    runs = problem.residual.runs
    return sum(float(np.square(run.weight).sum() * (ROUNDING * max(run.x.max(), -run.x.min())) ** 2) for run in runs)


def start_coordinates(problem: Problem) -> Any:
    """Return the start values in coordinates, within the bounds."""
    return np.clip(np.zeros(problem.residual.n_parameters), problem.limits.lower, problem.limits.upper)
