"""Criterion that compares fits of one record with different models.

The gain of model B over model A is the change of ``-2 ln(likelihood)`` with Schwarz's penalty,

    gain = [n ln(s^2) + (order + k) ln(n)]_A - [n ln(s^2) + (order + k) ln(n)]_B.

n is the number of rows in motion, k the number of parameters, and s^2 the variance of the innovations of the residuals
under an autoregressive process that is fitted to them (Brockwell and Davis, Time Series, 1991, 9.3). Each fit has its
process. So slow residuals count as noise as far as a process predicts them, and only the rest counts against a
model. The noise between neighbouring samples bounds s^2 from below, because it does not depend on the model.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...data.segmentation.noise import NORMAL_MAD
from ...estimation.autoregression import autoregression, innovations
from ..noise import Noise
from ..problem import Problem
from ..rows import Rows, run_in_rows
from ..solve import Solution

DECIDED = 20.0
"""Gain above which a model is preferred. Tuned: experiments/trials/run.py."""
RIVAL = 8.0
"""Difference of gains below which two models are rivals. Tuned: experiments/trials/run.py."""
_WAVES = (np.cos, np.sin)
# Lower bound of s^2 over the variance between neighbouring samples. At one, scatter of s^2 would hide a gain.
_FLOOR = 0.5
# Size of an outlier in standard deviations, and iterations between process and parameters.
_OUTLIER, _ITERATIONS = 8.0, 4


class Score(NamedTuple):
    """Parts of the criterion, summed over the runs of a fit.

    Attributes:
        rows: number of rows in motion, shape (runs,).
        logarithms: logarithm of s^2 of each run, shape (runs,).
        penalty: Schwarz's penalty.
    """

    rows: np.ndarray
    logarithms: np.ndarray
    penalty: float


def gain(one: Score, other: Score) -> float:
    """Return the gain of the model of `other` over that of `one`."""
    return float(one.rows @ (one.logarithms - other.logarithms)) + one.penalty - other.penalty


def score(problem: Problem, solution: Solution, noises: Sequence[Noise], names: Sequence[str] | None = None) -> Score:
    """Return the criterion of a fit.

    Args:
        problem: the problem.
        solution: its least-squares solution.
        noises: noise of each run; its hum is fitted together with the parameters.
        names: parameters that may move; None for all.
    """
    free = ~solution.shape.at_bound & np.array([names is None or name in names for name in problem.names])
    parts = [_run(problem, solution, run, noise, free) for run, noise in enumerate(noises)]
    rows, logarithms, orders = (np.array(each, float) for each in zip(*parts, strict=True))
    return Score(rows, logarithms, float(orders @ np.log(rows) + np.count_nonzero(free) * np.log(rows.sum())))


def moving_rows(problem: Problem, solution: Solution, run: int) -> tuple[Rows, np.ndarray]:
    """Return the rows of a run, and True for those in motion."""
    rows = run_in_rows(problem, solution.evaluation, run)
    return rows, rows.series.t <= problem.windows[run].stopped


def independent_noise(problem: Problem, run: int) -> float:
    """Return the noise between neighbouring samples, over the stated noise."""
    window = problem.windows[run]
    return window.segmentation.white_noise / window.stated


def _run(problem: Problem, solution: Solution, run: int, noise: Noise, free: np.ndarray) -> tuple[int, float, int]:
    """Return rows, logarithm of s^2 and order for one run."""
    rows, moving = moving_rows(problem, solution, run)
    series = rows.series
    t, residual = series.t[moving], series.residual[moving]
    starts = np.flatnonzero(np.diff(np.flatnonzero(moving), prepend=-2) > 1)
    beside = [np.ones(t.size), t, *(wave(2 * np.pi * line.frequency * t) for line in noise.lines for wave in _WAVES)]
    slopes = series.slopes[moving][:, : free.size][:, free]
    columns = np.column_stack([slopes, *(each * series.unit[moving] for each in beside)])
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    limit = _OUTLIER * max(np.median(np.abs(residual)) / NORMAL_MAD, np.std(residual) / 5)
    residual = np.clip(residual, -limit, limit)
    floor = max(_FLOOR * independent_noise(problem, run) ** 2, np.finfo(float).tiny)
    # Least squares may leave a misfit that passes for slow noise, so the process starts without it as well.
    white = columns @ np.linalg.lstsq(columns, residual, rcond=1e-9)[0]
    least = min(_iterated(columns, residual, left, starts, floor) for left in (residual, residual - white))
    return residual.size, least[1], least[2]


def _iterated(
    columns: np.ndarray, residual: np.ndarray, left: np.ndarray, starts: np.ndarray, floor: float
) -> tuple[float, float, int]:
    """Return criterion, logarithm of s^2 and order.

    The iteration starts from the process of the residuals `left`.
    """
    result = np.inf, np.inf, 0
    for _ in range(_ITERATIONS):
        coefficients, _ = autoregression(left - left.mean(), starts)
        white = innovations(np.column_stack([columns, residual]), starts, coefficients)
        step = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=1e-9)[0]
        variance = float(np.mean((white[:, -1] - white[:, :-1] @ step) ** 2))
        logarithm = float(np.log(max(variance, floor)))
        criterion = residual.size * logarithm + coefficients.size * np.log(residual.size)
        if not criterion < result[0] - 1e-3:
            break
        result, left = (criterion, logarithm, coefficients.size), residual - columns @ step
    return result
