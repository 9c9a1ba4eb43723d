"""Held-out score: the prediction of samples outside a fit.

With several runs, each run is held out in turn. The coefficients of the machine come from the other runs, and only the
start and the offset of the held-out run are fitted to it. With a single run, its first part is fitted and the rest is
predicted; only the number of half-cycles to the stop is that of the whole record. The score is the mean square of the
residuals of the held-out samples in units of their noise. It is one for the right law.

Each of these fits starts at the optimum of all samples, where the sums of each run are known, and takes Gauss-Newton
steps. Therefore no recompilation is needed. Most fits need a single step.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..estimation.covariance import Quadratic, quadratic
from ..fitting.evaluation import Evaluation
from ..fitting.problem import Problem
from ..fitting.residual import Residual
from ..fitting.solve import Solution, checking, evaluate_at

# Fitted fraction of a single run, up to its stop.
_SHARE = 2 / 3
# Tolerated step in standard errors, which changes chi^2 by a tenth, and maximum number of steps of a part. A step with
# a smaller gain is the last one too. Two laws are equally good if their chi^2 differ by less than two.
_NEAR, _STEPS = 0.3, 8
# Relative increases of the diagonal of J'J, tried in turn until a step improves the fit. The step of a poorly
# determined coefficient can leave the range of a nearly linear motion; the damping hardly shortens the other steps.
_DAMPING = (0.0, 1e-4, 1e-2, 1.0)


class _Part(NamedTuple):
    """Some of the samples, and the parameters fitted to them.

    Attributes:
        cost, gradient, normal: sums over these samples, as in an `Evaluation`.
        free: mask of the fitted parameters, shape (p,).
    """

    cost: float
    gradient: np.ndarray
    normal: np.ndarray
    free: np.ndarray


def held_out_score(problem: Problem, solved: Solution) -> float:
    """Compute the held-out score.

    It is the mean square of the held-out residuals in units of their noise, or NaN if no samples can be held out.
    """
    residual = checking(problem.residual, solved.y)
    if len(problem.windows) == 1:
        return _of_a_single_run(problem, solved, residual)
    chi2 = sum(_without_run(problem, solved, residual, run) for run in range(len(problem.windows)))
    return chi2 / problem.n_used


def _without_run(problem: Problem, solved: Solution, residual: Residual, run: int) -> float:
    """Sum of squares of one run, with its start and offset fitted."""
    nuisances = np.isin(np.arange(residual.n_parameters), list(residual.space.places(run).values()))

    def parts(seen: Evaluation) -> list[_Part]:
        alone = seen.runs[run]
        others = seen.cost - alone.cost, seen.gradient - alone.gradient, seen.normal - alone.normal
        return [_Part(*others, ~nuisances), _Part(alone.cost, alone.gradient, alone.normal, nuisances)]

    _, seen = _gauss_newton(problem, residual, solved.y, solved.evaluation, parts)
    held_out = problem.by_run(seen.residual)[run]
    return float(held_out @ held_out)


def _of_a_single_run(problem: Problem, solved: Solution, residual: Residual) -> float:
    """Score of the last part of a run, predicted from the first."""
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
    """Restrict the residual to some samples of a run.

    Only the weights change, so no recompilation is needed.
    """
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
    """Minimise the parts in turn with Gauss-Newton steps.

    Args:
        problem: the problem.
        residual: the residual.
        y: start coordinates.
        seen: evaluation of `residual` at `y`.
        parts: function that divides an evaluation into parts. Later parts follow each step of an earlier one, and are
            then fitted from its end.

    Returns:
        The coordinates at which no part has a significant step left, and the evaluation there.
    """
    p, limits, dampings = residual.n_parameters, problem.limits, _DAMPING
    for k in range(len(parts(seen))):
        for number in range(_STEPS):
            at, at_bound = parts(seen)[k:], (y[:p] <= limits.lower) | (y[:p] >= limits.upper)
            near = _NEAR * np.sqrt(max(float(seen.chi2) / problem.n_used, 1.0))
            # The first step is always taken, because the optimum of all samples depends on those that are held out.
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
    """Quadratic model of each part at the end of the previous steps."""
    p, shapes = at_bound.size, []
    step = np.zeros(p)
    for part in parts:
        normal = part.normal[:p, :p]
        damped = normal + damping * np.diag(np.diag(normal))
        shapes.append(quadratic(part.gradient[:p] + normal @ step, damped, ~part.free | at_bound))
        step = step + shapes[-1].step
    return shapes
