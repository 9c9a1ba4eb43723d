"""Timing jitter of the clock, and weights that account for it.

Jitter is noise that grows with velocity. A sample taken too late by dt reads x + v dt. The samples near a reversal,
where the mass hardly moves, then carry the most information, so the noise at rest must be known well. It is estimated
from the residuals of a fit with these weights, repeatedly.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from .problem import Problem, with_windows
from .rows import Rows
from .solve import Solution, checking, evaluate_at, solve
from .window import DITHERED, Window

# Largest number of solutions, relative change at which the weights have settled, and largest drop of the noise at rest
# in one solution.
_SOLUTIONS, _SETTLED, _STEP = 6, 0.05, 10.0
# Fewest rows that can show jitter, iterations of the weighted regression, and the fraction of quietest rows.
_FEWEST, _REWEIGHED, _QUIET = 16, 6, 0.1


class TimingJitter(NamedTuple):
    """A fit with its samples weighted by the timing jitter.

    Attributes:
        problem: the problem with the new weights; `solution`: its solution.
        jitters: jitter of each run; None for a run without significant jitter.
        gain: change of -2 log(likelihood) by the weights alone.
    """

    problem: Problem
    solution: Solution
    jitters: Sequence["Jitter | None"]
    gain: float


class Jitter(NamedTuple):
    """Noise with a variance that grows with the squared motion between samples."""

    still: float
    moving: float
    interval: float

    def size(self, moved: np.ndarray) -> np.ndarray:
        """Return the variance of samples, given the squared motion between samples."""
        return self.still + self.moving * moved

    @property
    def time(self) -> float:
        """Standard deviation of the instants [s]."""
        return self.interval * float(np.sqrt(self.moving))


def fit_timing_jitter(problem: Problem, solution: Solution, rows: Sequence[Rows]) -> TimingJitter | None:
    """Fit with samples weighted by the timing jitter.

    Return None if no jitter is significant or the fit fails.
    """
    jitters = [_estimate(*run) for run in zip(problem.windows, rows, strict=True)]
    if not any(jitters):
        return None
    evaluation = solution.evaluation
    if not evaluation.residual.size:
        evaluation = evaluate_at(problem, checking(problem.residual, solution.y), solution.y).evaluation
    weighed, again = problem, solution
    for _ in range(_SOLUTIONS):
        parts = zip(weighed.by_run(evaluation.residual), weighed.windows, strict=True)
        errors = [part * window.sigma for part, window in parts]
        before, jitters = jitters, [_refined(*run) for run in zip(problem.windows, errors, jitters, strict=True)]
        if weighed is not problem and all(map(_alike, before, jitters)):
            break
        weighed = with_windows(problem, tuple(map(_weighed, problem.windows, errors, jitters)))
        again = solve(weighed, again.y)
        if not again.converged:
            return None
        evaluation = again.evaluation
    pairs = zip(problem.windows, weighed.windows, strict=True)
    gain = sum(2 * float(np.sum(np.log(after.sigma / before.sigma)[before.used])) for before, after in pairs)
    return TimingJitter(weighed, again, jitters, gain)


def _estimate(window: Window, row: Rows) -> Jitter | None:
    """Estimate the jitter of a run; None if not significant.

    Second differences measure the white noise, which is larger where the mass moves if the instants jitter. A record
    with rounding as its only roughness cannot show jitter, because there the motion dithers the rounding.
    """
    level = float(np.median(row.rough))
    if (
        row.rough.size < _FEWEST
        or not level * window.stated**2 > DITHERED * (window.gain * window.segmentation.resolution) ** 2
    ):
        return None
    least = float(np.quantile(row.rough, _QUIET))
    # If all samples of these rows lie in the flat part of a robust loss, their noise is unknown.
    if not least > 0:
        return None
    (still, moving), error = _variances(row.rough, row.moved, np.maximum(row.rough, least), least)
    return Jitter(max(still, least), moving, row.interval) if moving > thresholds.SURE * error else None


def _variances(square: np.ndarray, moved: np.ndarray, size: np.ndarray, least: float) -> tuple[np.ndarray, float]:
    """Estimate the variance at rest and its increase with squared motion.

    Also return the standard error of the increase. `size` holds initial variances. Squares scatter in proportion to
    their mean, so the regression minimises relative errors and updates their weights at each step.
    """
    unit = float(np.mean(moved)) or 1.0
    columns = np.column_stack([np.ones(square.size), moved / unit])
    variances, error = np.zeros(2), np.inf
    for _ in range(_REWEIGHED):
        relative, target = columns / size[:, None], square / size
        gram, along = relative.T @ relative, relative.T @ target
        inverse = _inverse(gram)
        variances = inverse @ along
        if variances.min() < 0:
            alone = along / np.maximum(np.diag(gram), np.finfo(float).tiny)
            variances = np.where(np.arange(2) == np.argmax(alone * along), alone, 0.0)
        error = float(np.sqrt(np.mean((target - relative @ variances) ** 2) * inverse[1, 1]))
        size = np.maximum(columns @ variances, least)
        if variances[1] < error:
            break
    return variances / np.array([1.0, unit]), error / unit


def _inverse(gram: np.ndarray) -> np.ndarray:
    """Return the inverse or pseudo-inverse of a symmetric 2x2 matrix.

    The matrix is singular for a mass at rest. The closed form is 50 times faster than a decomposition, and each run
    needs several.
    """
    (a, b), (_, d) = gram
    determinant = a * d - b * b
    if determinant > 1e-12 * a * d:
        return np.array([[d, -b], [-b, a]]) / determinant
    return np.linalg.pinv(gram)


def _moved(window: Window, error: np.ndarray) -> np.ndarray:
    """Squared motion between samples, in units of the noise.

    `error` is computed minus measured displacement.
    """
    return (np.gradient(np.asarray(window.trace.x) + error) / window.sigma) ** 2


def _refined(window: Window, error: np.ndarray, jitter: Jitter | None) -> Jitter | None:
    """Refine the jitter, using the residuals of a fit weighted by it."""
    if jitter is None:
        return None
    used, moved, least = window.used, _moved(window, error), jitter.still / _STEP
    squares = (error / window.sigma) ** 2
    (still, moving), _ = _variances(squares[used], moved[used], jitter.size(moved[used]), least)
    return Jitter(max(float(still), least), float(moving), jitter.interval)


def _weighed(window: Window, error: np.ndarray, jitter: Jitter | None) -> Window:
    """Return the window with its samples weighted by their jitter."""
    if jitter is None:
        return window
    return dataclasses.replace(window, sigma=window.sigma * np.sqrt(jitter.size(_moved(window, error))))


def _alike(one: Jitter | None, other: Jitter | None) -> bool:
    return one is None or other is None or abs(np.log(one.still / other.still)) < _SETTLED
