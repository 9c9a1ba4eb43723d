"""Residuals of each run, averaged in rows of consecutive samples.

Rows are few enough for fast computation and short against the motion.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data.segmentation.noise import NORMAL_MAD
from ..estimation.colour import Colour, Series
from .evaluation import Block, Evaluation, block_length
from .problem import Problem
from .window import Window

# Rows in a half-cycle, and the fraction of its samples that a row must have.
_ROWS, _FULL = 40.0, 0.5
# Harmonics that describe the error of rounding. The first four contain five sixths of its power; the rest varies within
# an eighth of a step.
_HARMONICS = 4
# Noise over the step, rounding included, above which rounding does not show: half a step plus the error of rounding.
# Derived: the first harmonic is then reduced to exp(-pi^2 / 2), a part in 140.
_WIPED_OUT = (1 / 4 + 1 / 12) ** 0.5


class Rows(NamedTuple):
    """Residuals of a run in rows.

    Attributes:
        series: residuals in units in which white noise of the stated level has variance one.
        level: variance of a row if the samples of its run were independent.
        samples: number of samples in a row.
        interval: sampling interval [s].
        t, left, weight: time [s], weighted residual and weight of each sample, the last two zero for unused samples,
            shape (n,). `left` is empty if residuals of samples were not kept.
        rough: variance of the white noise in each row, shape (rows,).
        moved: mean squared change of the reading between samples in each row, shape (rows,).
    """

    series: Series
    level: float
    samples: int
    interval: float
    t: np.ndarray
    left: np.ndarray
    weight: np.ndarray
    rough: np.ndarray
    moved: np.ndarray


class Seen(NamedTuple):
    """Rows of a run and their noise model."""

    rows: Rows
    colour: Colour


def rows_of(problem: Problem, evaluation: Evaluation, seen: Sequence[Seen] = ()) -> list[Rows]:
    """Return the rows of each run.

    `seen` contains those of the previous step with their noise models.
    """
    return [
        run_in_rows(problem, evaluation, run, before=seen[run] if seen else None) for run in range(len(problem.windows))
    ]


def run_in_rows(
    problem: Problem, evaluation: Evaluation, run: int, samples: int | None = None, before: Seen | None = None
) -> Rows:
    """Return a run in rows of `samples` samples each.

    The default gives a fixed number of rows per half-cycle.
    """
    window, record, blocks = problem.windows[run], problem.residual.runs[run], evaluation.blocks[run]
    length, used = block_length(record.t.size), np.flatnonzero(window.used)
    interval = float(record.t[used[-1]] - record.t[used[0]]) / (used[-1] - used[0])
    wanted = samples or window.segmentation.half_period / interval / _ROWS
    each = max(round(wanted / length), 1)
    # Behind the last sample there is only padding.
    samples, begins = each * length, np.arange(0, used[-1] // length + 1, each)
    end = min((begins[-1] + each) * length, record.t.size)
    # Padding behind the last sample completes the last row.
    filled_up = np.zeros((begins.size * each, blocks.shape[1]))
    filled_up[: end // length] = blocks[: end // length]
    sums = filled_up.reshape(begins.size, each, -1).sum(axis=1)
    weight = np.add.reduceat(record.weight[:end], begins * length)
    instants = np.add.reduceat(record.t[:end] * (record.weight[:end] > 0), begins * length)
    kept = sums[:, Block._fields.index("used")] >= _FULL * samples
    row = Block.of(sums[kept])
    number = row.used
    scale = np.sqrt(samples) / number
    series = Series(
        t=instants[kept] / number,
        residual=row.residual * scale,
        slopes=row.slopes * scale[:, None],
        unit=row.curvature * scale * weight[kept] / number,
        rounding=_rounding(problem, evaluation, run, begins * length, before)[kept] * scale[:, None],
        starts=np.flatnonzero(np.diff(np.flatnonzero(kept), prepend=-2) > 1),
    )
    return Rows(
        series=series,
        level=float(row.square.sum() / number.sum()),
        samples=samples,
        interval=interval,
        t=np.asarray(record.t)[: window.used.size],
        left=problem.by_run(evaluation.residual)[run] if evaluation.residual.size else np.zeros(0),
        weight=np.asarray(record.weight)[: window.used.size],
        rough=row.rough / number,
        moved=row.moved / number,
    )


def rounded(window: Window) -> bool:
    """Return True if the rounding of a record shows.

    White noise of half a step hides it.
    """
    segmentation = window.segmentation
    return 0 < segmentation.white_noise <= segmentation.resolution / 2


def _rounding(
    problem: Problem, evaluation: Evaluation, run: int, begins: np.ndarray, before: Seen | None
) -> np.ndarray:
    """Return weighted row sums of the rounding error, shape (rows, k).

    The error of rounding to steps q is a function of the reading alone, ``q/pi sum_k (-1)^k/k sin(2 pi k x/q)`` (Widrow
    and Kollar, Quantization Noise, 2008, 3). The columns are its first harmonics for the computed reading. k is 0 if
    rounding does not show or residuals of samples were not kept. It is also 0 if the computed reading, with drift and
    hum of the previous step, differs from the record by more than half a step: slow noise hides rounding as white noise
    does, and the phase of the harmonics would change at each step of the fit.
    """
    window, weight = problem.windows[run], np.asarray(problem.residual.runs[run].weight)
    none = np.zeros((begins.size, 0))
    if not rounded(window) or not evaluation.residual.size:
        return none
    x, left = np.asarray(window.trace.x), problem.by_run(evaluation.residual)[run]
    weight = weight[: x.size]
    missed = np.divide(left, weight, out=np.zeros(x.size), where=weight > 0)
    if before is not None:
        missed = missed + before.colour.at(before.rows.t, before.rows.series.t)
    step = window.gain * window.segmentation.resolution
    if np.median(np.abs(missed[weight > 0])) / NORMAL_MAD > step * _WIPED_OUT:
        return none
    phase = 2 * np.pi * (x + missed - x[0]) / step
    waves = [np.add.reduceat(weight * np.sin(k * phase), begins) for k in range(1, _HARMONICS + 1)]
    return np.column_stack(waves)
