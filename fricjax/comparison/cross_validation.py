"""How well a fitted law predicts what it was not fitted to: the held-out score.

Of several runs each is left out in turn: the coefficients of the machine come from the others, and only the start and
the offset of the run itself are fitted to it. Of a single run the first part is fitted and the rest is predicted; only
the number of half-cycles to the stop is that of the record. The score is the mean square of the residuals of the
held-out samples in units of their noise: one for the right law.

Every such fit starts at the optimum of all samples, where the sums of each run are known, and takes Gauss-Newton steps,
so that nothing is compiled anew. Most arrive with the first.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..estimation.covariance import Quadratic, quadratic
from ..fitting.evaluation import Evaluation
from ..fitting.problem import Problem
from ..fitting.residual import Residual
from ..fitting.solve import Solution, checking, evaluate_at

# Part of a single run, to its stop, that is fitted.
_SHARE = 2 / 3
# Step in standard errors that may be left, which is a tenth of chi^2, and most steps of a part. A step that gains less
# than that is the last one too. Laws whose chi^2 differs by two are called equally good.
_NEAR, _STEPS = 0.3, 8
# By how much the diagonal of J'J is enlarged, one after the other, where a step makes nothing better: a coefficient
# that is poorly determined leads out of where the motion is nearly linear; the others need not go less far for it.
_DAMPING = (0.0, 1e-4, 1e-2, 1.0)


class _Part(NamedTuple):
    """A part of the samples at some coordinates, and the parameters that are fitted to it.

    Attributes:
        cost, gradient, normal: sums over these samples, as those of an `Evaluation`.
        free: shape (p,).
    """

    cost: float
    gradient: np.ndarray
    normal: np.ndarray
    free: np.ndarray


def held_out_score(problem: Problem, solved: Solution) -> float:
    """Mean square of the held-out residuals in units of their noise; NaN where nothing can be held out."""
    residual = checking(problem.residual, solved.y)
    if len(problem.windows) == 1:
        return _of_a_single_run(problem, solved, residual)
    chi2 = sum(_without_run(problem, solved, residual, run) for run in range(len(problem.windows)))
    return chi2 / problem.n_used


def _without_run(problem: Problem, solved: Solution, residual: Residual, run: int) -> float:
    """Sum of squares of one run, whose own parameters alone are fitted to it."""
    nuisances = np.isin(np.arange(residual.n_parameters), list(residual.space.places(run).values()))

    def parts(seen: Evaluation) -> list[_Part]:
        alone = seen.runs[run]
        others = seen.cost - alone.cost, seen.gradient - alone.gradient, seen.normal - alone.normal
        return [_Part(*others, ~nuisances), _Part(alone.cost, alone.gradient, alone.normal, nuisances)]

    _, seen = _gauss_newton(problem, residual, solved.y, solved.evaluation, parts)
    held_out = problem.by_run(seen.residual)[run]
    return float(held_out @ held_out)


def _of_a_single_run(problem: Problem, solved: Solution, residual: Residual) -> float:
    """The score of the last part of a run, predicted from the first."""
    window = problem.windows[0]
    t, segmentation = np.asarray(window.trace.t), window.segmentation
    end = t[-1] if segmentation.rest is None else segmentation.rest
    split = t <= window.origin + _SHARE * (end - window.origin)
    later = window.used & ~split
    reversals = (segmentation.turning_times > window.t_start) & (segmentation.turning_times <= t[split][-1])
    # Fewer than two half-cycles determine no friction.
    if not later.any() or np.sum(reversals) < 2:
        return float("nan")
    fitted = _only(residual, window.used & split)

    def parts(seen: Evaluation) -> list[_Part]:
        return [_Part(seen.cost, seen.gradient, seen.normal, np.ones(residual.n_parameters, bool))]

    begin = evaluate_at(problem, fitted, solved.y).evaluation
    y, _ = _gauss_newton(problem, fitted, solved.y, begin, parts)
    (held_out,) = problem.by_run(evaluate_at(problem, _only(residual, later), y).evaluation.residual)
    return float(held_out @ held_out) / int(later.sum())


def _only(residual: Residual, samples: np.ndarray) -> Residual:
    """The residual of these samples of a run alone: weights change, so that nothing is compiled anew."""
    (run,) = residual.runs
    some = np.pad(samples, (0, run.weight.size - samples.size))
    return residual.with_runs(weight=[np.where(some, run.weight, 0.0)])


def _gauss_newton(
    problem: Problem,
    residual: Residual,
    y: np.ndarray,
    seen: Evaluation,
    parts: Callable[[Evaluation], list[_Part]],
) -> tuple[np.ndarray, Evaluation]:
    """Coordinates at which no part has a step left that counts, and the evaluation of `residual` there.

    Args:
        problem: the problem.
        residual: what is evaluated.
        y: coordinates to begin from.
        seen: the evaluation there.
        parts: those of an evaluation; the later ones go along with each step and are fitted from where it ends.
    """
    p, limits, dampings = residual.n_parameters, problem.limits, _DAMPING
    for k in range(len(parts(seen))):
        for number in range(_STEPS):
            at, at_bound = parts(seen)[k:], (y[:p] <= limits.lower) | (y[:p] >= limits.upper)
            near = _NEAR * np.sqrt(max(float(seen.chi2) / problem.n_used, 1.0))
            # One step is always taken: the optimum of all samples has seen those that are held out.
            if (k or number) and _shapes(at[:1], at_bound, 0.0)[0].distance < near:
                break
            for damping in dampings:
                trial, step = y.copy(), sum(shape.step for shape in _shapes(at, at_bound, damping))
                trial[:p] = np.clip(y[:p] + step, limits.lower, limits.upper)
                tried = evaluate_at(problem, residual, trial).evaluation
                gain = at[0].cost - parts(tried)[k].cost
                if gain > 0 or not np.isfinite(at[0].cost):
                    break
            else:
                break
            y, seen, dampings = trial, tried, dampings[dampings.index(damping) :]
            if gain < near**2 / 2:
                break
    return y, seen


def _shapes(parts: Sequence[_Part], at_bound: np.ndarray, damping: float) -> list[Quadratic]:
    """The quadratic form of each part where the steps of those before it end."""
    p, shapes = at_bound.size, []
    step = np.zeros(p)
    for part in parts:
        normal = part.normal[:p, :p]
        damped = normal + damping * np.diag(np.diag(normal))
        shapes.append(quadratic(part.gradient[:p] + normal @ step, damped, ~part.free | at_bound))
        step = step + shapes[-1].step
    return shapes
