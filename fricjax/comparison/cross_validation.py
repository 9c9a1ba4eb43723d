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

import numpy as np

from .. import thresholds
from ..estimation.covariance import quadratic
from ..fitting.evaluation import Evaluation
from ..fitting.problem import Problem
from ..fitting.residual import Residual
from ..fitting.solve import Solution, checking, evaluate_at

# Part of a single run, to its stop, that is fitted.
_SHARE = 2 / 3
# Most Gauss-Newton steps of a fold and how often one is halved that does not make the fit better.
_STEPS, _HALVINGS = 8, 4


class _Fold(NamedTuple):
    """Which samples of each run are fitted and which predicted, and the run whose nuisances are fitted there."""

    fitted: list[np.ndarray]
    predicted: list[np.ndarray]
    refitted: int | None


def held_out_score(problem: Problem, solved: Solution) -> float:
    """Mean square of the held-out residuals in units of their noise; NaN where nothing can be held out."""
    residual = checking(problem.residual, solved.y)
    chi2, count = 0.0, 0
    for fold in _folds(problem):
        y, _ = _gauss_newton(_only(residual, fold.fitted), solved.y, problem, None)
        predicted = _only(residual, fold.predicted)
        if fold.refitted is None:
            evaluation = evaluate_at(problem, predicted, y).evaluation
        else:
            _, evaluation = _gauss_newton(predicted, y, problem, fold.refitted)
        chi2 += sum(float(part @ part) for part in problem.by_run(evaluation.residual))
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
    t, segmentation = np.asarray(window.trace.t), window.segmentation
    end = t[-1] if segmentation.rest is None else segmentation.rest
    split = t <= window.origin + _SHARE * (end - window.origin)
    later = window.used & ~split
    reversals = (segmentation.turning_times > window.t_start) & (segmentation.turning_times <= t[split][-1])
    # Fewer than two half-cycles determine no friction.
    if later.any() and np.sum(reversals) >= 2:
        yield _Fold([window.used & split], [later], None)


def _only(residual: Residual, samples: list[np.ndarray]) -> Residual:
    """The residual of these samples alone: weights change, so that nothing is compiled anew."""
    weights = [
        np.where(np.pad(part, (0, run.weight.size - part.size)), run.weight, 0.0)
        for part, run in zip(samples, residual.runs, strict=True)
    ]
    return residual.with_runs(weight=weights)


def _gauss_newton(
    residual: Residual, y: np.ndarray, problem: Problem, run: int | None
) -> tuple[np.ndarray, Evaluation]:
    """Coordinates that fit `residual`, of all parameters or of the nuisances of one run, and the evaluation there."""
    p, space, limits = residual.n_parameters, residual.space, problem.limits
    fixed = np.zeros(p, bool)
    if run is not None:
        first = len(space.leaves) + sum(len(names) for names in space.nuisances[:run])
        fixed[:first] = fixed[first + len(space.nuisances[run]) :] = True
    cost = lambda at: float(at.cost) if np.isfinite(at.cost) else np.inf
    evaluation = evaluate_at(problem, residual, y).evaluation
    for _ in range(_STEPS):
        at_bound = (y[:p] <= limits.lower) | (y[:p] >= limits.upper)
        shape = quadratic(evaluation.gradient[:p], evaluation.normal[:p, :p], fixed | at_bound)
        scatter = max(float(evaluation.chi2) / max(problem.n_used, 1), 1.0)
        if shape.distance < thresholds.ACCURATE * np.sqrt(scatter):
            break
        step = np.concatenate([shape.step, np.zeros(y.size - p)])
        for halving in range(_HALVINGS):
            trial = y + step / 2**halving
            trial[:p] = np.clip(trial[:p], limits.lower, limits.upper)
            tried = evaluate_at(problem, residual, trial).evaluation
            if cost(tried) < cost(evaluation):
                break
        else:
            break
        y, evaluation = trial, tried
    return y, evaluation
