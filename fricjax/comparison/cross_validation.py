"""How well a fitted law predicts what it was not fitted to: the held-out score.

Of several runs each is left out in turn: the coefficients of the machine come from the others, and only the start and
the offset of the run itself are fitted to it. Of a single run the first part is fitted and the rest is predicted; only
the number of half-cycles to the stop is that of the record. The score is the mean square of the residuals of the
held-out samples in units of their noise: one for the right law.

Every such fit starts at the optimum of all samples and takes Gauss-Newton steps with other weights, so that nothing
is compiled anew.
"""

from collections.abc import Iterator
from typing import NamedTuple

import equinox as eqx
import numpy as np

from ..estimation.covariance import quadratic
from ..fitting.evaluation import Evaluation
from ..fitting.problem import Problem
from ..fitting.residual import Residual
from ..fitting.solve import Solution, checking, evaluate_at

_SHARE = 2 / 3
_STEPS, _HALVINGS = 8, 4
_NEAR = 0.1


class _Fold(NamedTuple):
    """Which samples of each run are fitted and which predicted, and the run whose own parameters are fitted to them."""

    fitted: list[np.ndarray]
    predicted: list[np.ndarray]
    refitted: int | None


def held_out_score(problem: Problem, solved: Solution) -> float:
    """Mean square of the held-out residuals in units of their noise; NaN where nothing can be held out."""
    residual = checking(problem.residual, solved.y)
    chi2, count = 0.0, 0
    for fold in _folds(problem):
        y, _ = _fitted(_weighing(residual, fold.fitted), solved.y, problem, None)
        seen = _weighing(residual, fold.predicted)
        found = (
            evaluate_at(problem, seen, y).evaluation
            if fold.refitted is None
            else _fitted(seen, y, problem, fold.refitted)[1]
        )
        chi2 += sum(float(part @ part) for part in problem.by_run(found.residual))
        count += int(sum(part.sum() for part in fold.predicted))
    return chi2 / count if count else float("nan")


def _folds(problem: Problem) -> Iterator[_Fold]:
    used = [window.used for window in problem.windows]
    if len(used) > 1:
        for run in range(len(used)):
            others = [part & (i != run) for i, part in enumerate(used)]
            yield _Fold(others, [part & (i == run) for i, part in enumerate(used)], run)
        return
    window = problem.windows[0]
    t, found = np.asarray(window.trace.t), window.segmentation
    end = t[-1] if found.rest is None else found.rest
    split = t <= window.origin + _SHARE * (end - window.origin)
    later = window.used & ~split
    # Fewer than two half-cycles determine no friction.
    if later.any() and np.sum((found.turning_times > window.t_start) & (found.turning_times <= t[split][-1])) >= 2:
        yield _Fold([window.used & split], [later], None)


def _weighing(residual: Residual, samples: list[np.ndarray]) -> Residual:
    """The residual of these samples alone."""
    weights = [
        np.where(np.pad(part, (0, run.weight.size - part.size)), run.weight, 0.0)
        for part, run in zip(samples, residual.runs, strict=True)
    ]
    return eqx.tree_at(lambda r: [run.weight for run in r.runs], residual, weights)


def _fitted(residual: Residual, y: np.ndarray, problem: Problem, run: int | None) -> tuple[np.ndarray, Evaluation]:
    """Coordinates that fit `residual`, of all parameters or of those of one run, and what is found there.

    They are reached by Gauss-Newton steps from `y`.
    """
    p = residual.n_parameters
    held = np.zeros(p, bool) if run is None else ~_own(residual, run)
    found = evaluate_at(problem, residual, y).evaluation
    for _ in range(_STEPS):
        at_bound = (y[:p] <= problem.limits.lower) | (y[:p] >= problem.limits.upper)
        shape = quadratic(found.gradient[:p], found.normal[:p, :p], held | at_bound)
        scatter = max(float(found.chi2) / max(problem.n_used, 1), 1.0)
        if shape.distance < _NEAR * np.sqrt(scatter):
            break
        step = np.concatenate([shape.step, np.zeros(y.size - p)])
        trial, better = _descended(residual, y, step, found, problem)
        if trial is None or better is None:
            break
        y, found = trial, better
    return y, found


def _descended(
    residual: Residual, y: np.ndarray, step: np.ndarray, found: Evaluation, problem: Problem
) -> tuple[np.ndarray | None, Evaluation | None]:
    """The longest of the halved steps that makes the fit better, and what is found there."""
    p, cost = residual.n_parameters, _cost(found)
    for halving in range(_HALVINGS):
        trial = y + step / 2**halving
        trial[:p] = np.clip(trial[:p], problem.limits.lower, problem.limits.upper)
        tried = evaluate_at(problem, residual, trial).evaluation
        if _cost(tried) < cost:
            return trial, tried
    return None, None


def _cost(found: Evaluation) -> float:
    return float(found.cost) if np.isfinite(found.cost) else np.inf


def _own(residual: Residual, run: int) -> np.ndarray:
    """Which parameters are those of one run."""
    space = residual.space
    first = len(space.leaves) + sum(len(names) for names in space.nuisances[:run])
    own = np.zeros(residual.n_parameters, bool)
    own[first : first + len(space.nuisances[run])] = True
    return own
