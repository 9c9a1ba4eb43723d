"""Unexplained motion: slow residuals, except drift and hum."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ... import thresholds
from ..noise import Noise
from ..problem import Problem
from ..rows import run_in_rows
from ..solve import Solution
from ..window import Window

NEAR = 0.2
"""Distance of a frequency from that of the oscillator, relative to it, within which it may belong to it. Convention."""


class Unexplained(NamedTuple):
    """Slow residuals of the worst run.

    Attributes:
        size: root mean square in motion or at rest, whichever is larger, in the unit of the record.
        share: the same relative to the motion.
        run: number of the run.
        at_rest: True if the rest has the larger residuals.
        frequency: main frequency of the residuals [Hz].
        late: share in the last third of the motion; a drive shows there.
    """

    size: float
    share: float
    run: int
    at_rest: bool
    frequency: float
    late: float


def unexplained(problem: Problem, solution: Solution, noises: Sequence[Noise]) -> Unexplained:
    """Return the unexplained motion of the worst run."""
    parts = [_of_run(problem, solution, run, noise) for run, noise in enumerate(noises)]
    return max(parts, key=lambda part: part.share)


def _of_run(problem: Problem, solution: Solution, run: int, noise: Noise) -> Unexplained:
    window, rows = problem.windows[run], run_in_rows(problem, solution.evaluation, run)
    series, frequency = rows.series, float(solution.derived.kinematics[0])
    multiples = {line: line.frequency / frequency for line in noise.lines}
    # A line at the natural frequency or one of its first multiples may be motion.
    hum = tuple(line for line, m in multiples.items() if m > 3 + NEAR or (m > 1 and abs(m - round(m)) > NEAR))
    residual = series.residual + noise._replace(lines=hum).at(series.t) * series.unit
    x = np.asarray(window.trace.x)[window.moving]
    swing = max(float(np.std(x)), np.finfo(float).tiny)
    moving, rest = series.t <= window.stopped, series.t > window.stopped + window.segmentation.half_period / 2
    sizes = [float(np.sqrt(_slow(residual[part]) / rows.samples)) * window.stated for part in (moving, rest)]
    size = max(sizes)
    begin = float(np.quantile(series.t[moving], 2 / 3)) if moving.any() else 0.0
    last = moving & (series.t >= begin)
    t = np.asarray(window.trace.t)[window.moving] - window.origin
    least = max(float(np.std(x[t >= begin])) if np.any(t >= begin) else swing, np.finfo(float).tiny)
    late = float(np.sqrt(_slow(residual[last]) / rows.samples)) * window.stated / least
    return Unexplained(size, size / swing, run, sizes[1] > sizes[0], _frequency(series.t, residual), late)


def _slow(residual: np.ndarray) -> float:
    """Return the significant variance of the slow part of residuals.

    It is the covariance of adjacent rows, to which white noise adds nothing, less its standard errors for white noise.
    """
    if residual.size < 2:
        return 0.0
    scatter = float(np.mean(residual**2)) / np.sqrt(residual.size)
    return max(float(np.mean(residual[1:] * residual[:-1])) - thresholds.SUSPECTED * scatter, 0.0)


def _frequency(t: np.ndarray, residual: np.ndarray) -> float:
    """Return the main frequency of residuals [Hz]."""
    spectrum = np.abs(np.fft.rfft((residual - residual.mean()) * np.hanning(residual.size)))
    spectrum[:2] = 0.0
    return float(np.argmax(spectrum) / max(np.ptp(t), np.finfo(float).tiny))


def rises(window: Window) -> bool:
    """Return True if the amplitude rises again by a significant share."""
    segmentation = window.segmentation
    paths = np.abs(np.diff(segmentation.turning_points))
    if paths.size < 2:
        return False
    rise = float(np.max(paths - np.minimum.accumulate(paths)))
    return rise > max(thresholds.EXTREME * segmentation.white_noise, thresholds.UNDESCRIBED * float(paths.max()))
