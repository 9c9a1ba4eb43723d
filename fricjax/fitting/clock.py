"""The jitter of a clock: noise that grows with velocity, by which the samples are weighed.

A sample that is taken too late by dt reads x + v dt. The samples next to a reversal, where the mass hardly moves, are
then the ones that count, so that it is they which must be weighed, and what noise they have at rest is shown by
themselves: by the residuals of a fit that is weighed so, in turn.
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

# Solutions until the weights settle to a part of themselves, and the factor by which the noise at rest may fall in one.
_SOLUTIONS, _SETTLED, _STEP = 6, 0.05, 10.0
# Rows that tell a jitter, rounds in which their weights settle, and the part of them that is the quietest.
_FEWEST, _REWEIGHED, _QUIET = 16, 6, 0.1


class Clocked(NamedTuple):
    """A fit whose samples are weighed by their jitter.

    Attributes:
        problem: with other weights of the samples; `solution`: its solution.
        jitters: of each run, None where nothing shows.
        gain: what the weights add to minus twice the logarithm of the likelihood.
    """

    problem: Problem
    solution: Solution
    jitters: Sequence["Jitter | None"]
    gain: float


class Jitter(NamedTuple):
    """Noise that grows with velocity: its variance at rest, what squared motion from sample to sample adds to it."""

    still: float
    moving: float
    interval: float

    def size(self, moved: np.ndarray) -> np.ndarray:
        """Variance of samples between which the reading moves so far, squared."""
        return self.still + self.moving * moved

    @property
    def time(self) -> float:
        """Standard deviation of the instants [s]."""
        return self.interval * float(np.sqrt(self.moving))


def by_clock(problem: Problem, solution: Solution, rows: Sequence[Rows]) -> Clocked | None:
    """The fit weighed by the jitter of its clock; None where none shows in its rows, or where it fails under it."""
    jitters = [_seen(*run) for run in zip(problem.windows, rows, strict=True)]
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
    return Clocked(weighed, again, jitters, gain)


def _seen(window: Window, row: Rows) -> Jitter | None:
    """What the clock of a run adds to its noise; None where nothing shows.

    Second differences show the white noise, and more of it where the mass moves while the instants jitter. A record
    that rounding alone makes rough tells nothing, for there it is the motion that dithers it.
    """
    level = float(np.median(row.rough))
    if row.rough.size < _FEWEST or not level * window.stated**2 > DITHERED * window.segmentation.resolution**2:
        return None
    least = float(np.quantile(row.rough, _QUIET))
    # Of rows whose samples all lie beyond the bend of a robust loss nothing is known.
    if not least > 0:
        return None
    (still, moving), error = _variances(row.rough, row.moved, np.maximum(row.rough, least), least)
    return Jitter(max(still, least), moving, row.interval) if moving > thresholds.SURE * error else None


def _variances(square: np.ndarray, moved: np.ndarray, size: np.ndarray, least: float) -> tuple[np.ndarray, float]:
    """Variance at rest and what squared motion adds to it, from squares of that size, with the error of the latter.

    Squares scatter in proportion to their mean, so that the regression counts relative errors, anew at each step.
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
    """Inverse of a symmetric matrix of two rows, or the nearest thing to one, as for a mass that rests.

    A decomposition takes fifty times longer, and each run asks for several.
    """
    (a, b), (_, d) = gram
    determinant = a * d - b * b
    if determinant > 1e-12 * a * d:
        return np.array([[d, -b], [-b, a]]) / determinant
    return np.linalg.pinv(gram)


def _moved(window: Window, error: np.ndarray) -> np.ndarray:
    """Squared motion from sample to sample, in units of the noise; errors are computed minus measured displacement."""
    return (np.gradient(np.asarray(window.trace.x) + error) / window.sigma) ** 2


def _refined(window: Window, error: np.ndarray, jitter: Jitter | None) -> Jitter | None:
    """The jitter as the samples themselves tell it, of a fit that is weighed by it."""
    if jitter is None:
        return None
    used, moved, least = window.used, _moved(window, error), jitter.still / _STEP
    squares = (error / window.sigma) ** 2
    (still, moving), _ = _variances(squares[used], moved[used], jitter.size(moved[used]), least)
    return Jitter(max(float(still), least), float(moving), jitter.interval)


def _weighed(window: Window, error: np.ndarray, jitter: Jitter | None) -> Window:
    """The window with its samples weighed by their jitter."""
    if jitter is None:
        return window
    return dataclasses.replace(window, sigma=window.sigma * np.sqrt(jitter.size(_moved(window, error))))


def _alike(one: Jitter | None, other: Jitter | None) -> bool:
    return one is None or other is None or abs(np.log(one.still / other.still)) < _SETTLED
