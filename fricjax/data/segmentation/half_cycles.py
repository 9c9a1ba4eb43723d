"""The half-cycles of a decaying swing, followed by its clock and its decrement.

A threshold on neighbouring samples cannot tell a half-cycle from the noise of an instrument, which is coloured, hums
and is rounded. What can is the order of a decay: its large half-cycles give the half-period, and the clock goes on from
there. Every further half-period of the record is searched for the half-cycle that belongs there, a half-cosine in the
direction whose turn it is; `stop` then says how many of them are motion.
"""

from typing import NamedTuple

import numpy as np

from . import stop
from .swing import Swing, extremes, zigzag

# A factor of two in either direction changes no count in `tests/data`, and mu by a fraction of its standard error in
# `experiments/honesty/run.py --thresholds`: no threshold here or in `stop` is tuned closely.
# Part of the span from which a half-cycle is seen without any clock: far above any noise in which friction is resolved.
SURE = 0.1
# How far about the predicted reversal it is sought, and how far from there it is believed, in half-periods.
SOUGHT, BELIEVED = 0.2, 0.12
# Part of the half-cycle before at which one is taken for the last one by the clock, which then runs on by itself.
TINY = 0.02
# Half-cycles from the pole on that may last any time, for a hand may lead or hold the mass.
STEADY = 3
# Standard errors within which a period does not depend on the amplitude; durations that can show that it does.
ISOCHRONOUS, DURATIONS = 4.0, 6
# How many times shorter or longer than the typical half-cycle the small ones may last: those of a pendulum are half as
# long as from near its top. Convention.
FOLDS = 4.0
# Averages per half-cycle from which its size is computed.
PER_HALF_CYCLE = 256


class HalfCycles(NamedTuple):
    """The half-cycles of a record.

    **Fields:**

    - `edges`: instants at which they begin and end [s]: the pole from which the motion starts, the reversals, and the
      stop where there is one, shape `(n + 1,)`.
    - `stopped`: whether the mass comes to rest; otherwise the record ends in motion.
    - `open`: other numbers of half-cycles that the record leaves possible.
    """

    edges: np.ndarray
    stopped: bool
    open: tuple[int, ...]


def find_half_cycles(swing: Swing, visible: float) -> HalfCycles | None:
    """The half-cycles of a record, None where it never moves; the noise left by smoothing spans less than `visible`."""
    share = max(SURE * float(np.ptp(swing.smoothed)), visible)
    pivots = zigzag(swing.smoothed, extremes(swing.smoothed, share), share)
    if not pivots:
        return None
    edges = _large(swing, pivots)
    if edges.size < 2:
        return HalfCycles(edges, False, ())
    # Of several decays in one record the trend of the durations may lead to none or less.
    period = float(np.clip(_small_period(swing, edges), swing.half_period / FOLDS, swing.half_period * FOLDS))
    large = edges.size - 1
    side = float(np.sign(np.subtract(*np.interp(edges[[-1, -2]], swing.t, swing.smoothed))))
    edges = _by_clock(swing, edges, side, period)
    size, error, misfit = _sizes(swing, edges, side * (-1.0) ** (np.arange(edges.size - 1) - large + 1))
    number, stopped, others = stop.find_stop(swing, edges, size, error, misfit, large)
    return HalfCycles(edges[: number + 1], stopped, others)


def _large(swing: Swing, pivots: list[int]) -> np.ndarray:
    """Instants of the pole and of the reversals between large half-cycles; missing samples hide none of them."""
    t = swing.t
    if len(pivots) == 2:
        # A lone half-cycle: the mass may have been held before, or go on to creep, so that its middle is surest.
        begin, end = pivots
        way = np.abs(swing.smoothed[begin : end + 1] - swing.smoothed[begin])
        middle = float(t[begin + int(np.argmax(way >= 0.5 * way[-1]))])
        edges = middle + 0.5 * swing.half_period * np.array([-1.0, 1.0])
        return np.maximum(edges, t[0])[: 2 if edges[1] + stop.SHORTEST_REST * swing.half_period <= t[-1] else 1]
    edges = t[pivots[:-1]]
    if edges.size > 1:
        side = float(np.sign(np.subtract(*swing.smoothed[[pivots[-2], pivots[-3]]])))
        last = _reversal(swing, float(edges[-1]), swing.half_period, side)
        # A spike beside a reversal is one of its own, before which no parabola leads.
        edges[-1] = last if last > edges[-2] else edges[-1]
    # Near the smallest size some half-cycles are seen and others missed: the clock goes on from the first one missed.
    missed = np.flatnonzero(np.diff(edges)[STEADY:] > 2 * np.diff(edges)[STEADY - 1 : -1])
    edges = edges[: STEADY + 1 + int(missed[0])] if missed.size else edges
    gaps = t[:-1][np.diff(t) > 0.5 * swing.half_period]
    hidden = np.searchsorted(edges, gaps)
    for i in np.unique(hidden[(hidden > 0) & (hidden < edges.size)])[::-1]:
        # Extremes alternate, so that an even number of them is missing.
        missing = 2 * round(float((edges[i] - edges[i - 1]) / swing.half_period - 1) / 2)
        edges = np.insert(edges, i, np.linspace(edges[i - 1], edges[i], missing + 2)[1:-1])
    return edges


def _small_period(swing: Swing, edges: np.ndarray) -> float:
    """Duration of the half-cycles after those seen [s]: their mean, or the last one's where it varies with the size."""
    durations = np.diff(edges)[1:] if edges.size > 2 else np.array([swing.half_period])
    at = np.interp(edges, swing.t, swing.smoothed)
    weight = np.abs(np.diff(at))[-durations.size :]
    mean = float(np.average(durations, weights=weight**2))
    if durations.size < DURATIONS:
        return mean
    # The period of a pendulum goes with the square of its amplitude, to first order.
    square = weight**2 - np.average(weight**2, weights=weight**2)
    slope = np.sum(weight**2 * square * durations) / np.sum(weight**2 * square**2)
    residual = durations - mean - slope * square
    slope_error = np.sqrt(np.sum(weight**2 * residual**2) / (durations.size - 2) / np.sum(weight**2 * square**2))
    return float(mean + slope * square[-1]) if abs(slope) > ISOCHRONOUS * slope_error else mean


def _by_clock(swing: Swing, edges: np.ndarray, side: float, period: float) -> np.ndarray:
    """The reversals followed by those that the clock predicts up to the end of the record, each moved to its extreme.

    Where there is no extreme near the prediction, as at rest, the clock is believed.
    """
    t, x, times = swing.t, swing.smoothed, list(edges)
    places, free_running = np.interp(edges, t, x).tolist(), False
    while times[-1] + period <= t[-1]:
        at, side = times[-1] + period, -side
        # After a half-cycle this small there is none to be followed, and wiggles at rest must not set the clock.
        free_running = free_running or abs(np.interp(at, t, x) - places[-1]) < TINY * abs(places[-1] - places[-2])
        if not free_running:
            at = _reversal(swing, at, period, side)
        times.append(at)
        places.append(float(np.interp(at, t, x)))
    return np.array(times)


def _reversal(swing: Swing, at: float, period: float, side: float) -> float:
    """The extreme nearest a predicted instant [s], a maximum for a positive `side`; the prediction for none near."""
    t, x, reach = swing.t, swing.smoothed, SOUGHT * period
    near = slice(*np.searchsorted(t, [at - reach, at + reach]))
    every = (near.stop - near.start) // 128 + 1
    u, y = (t[near][::every] - at) / reach, x[near][::every]
    if u.size < 5:
        return at
    y, square = y - y.mean(), u * u
    # Least squares of a parabola on times that lie about as far on either side.
    slope = float(u @ y) / float(square.sum())
    square -= square.mean()
    curve = float(square @ y) / float(square @ square)
    shift = -slope / (2 * curve) if side * curve < 0 else np.inf
    # Friction bends a reversal as hard as the half-cycles on either side are large, so that a parabola comes too late:
    # by 3/8 of the reach, the ratio of the mean of |u|^3 to twice that of u^2, times their difference over their sum.
    here, before, after = np.interp([at, at - period, at + period], t, x)
    seen = 0.5 - 0.5 * np.cos(np.pi * np.clip((t[-1] - at) / period, SOUGHT, 1.0))
    sizes = abs(here - before), abs(after - here) / seen
    shift -= 0.375 * np.subtract(*sizes) / max(np.sum(sizes), swing.threshold)
    return at + reach * shift if abs(shift) * SOUGHT <= BELIEVED else at


def _sizes(swing: Swing, edges: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Size of the half-cosine in each half-cycle, its standard error in white noise, and the variance beside it."""
    cell = int(swing.half_period / swing.interval) // PER_HALF_CYCLE + 1
    length = swing.t.size // cell * cell
    t, x = (values[:length].reshape(-1, cell).mean(axis=1) for values in (swing.t, swing.x))
    places = np.searchsorted(t, edges)
    count = np.diff(places).astype(float)
    used = slice(places[0], places[-1])
    number = np.repeat(np.arange(count.size), np.diff(places))
    t, x = t[used], x[used] - x[used].mean()
    shape = 0.5 - 0.5 * np.cos(np.pi * (t - edges[number]) / (edges[number + 1] - edges[number]))

    def sums(values: np.ndarray) -> np.ndarray:
        return np.bincount(number, values, minlength=count.size)

    # Linear regression of x on the half-cosine, in all half-cycles at once.
    n = np.maximum(count, 1.0)
    mean_shape, mean_x = sums(shape) / n, sums(x) / n
    h, y = shape - mean_shape[number], x - mean_x[number]
    square, product = sums(h * h), sums(h * y)
    resolved = (count >= 4) & (square > 0.02 * count)
    size = np.where(resolved, product / np.where(resolved, square, 1.0), 0.0)
    misfit = np.maximum(sums(y * y) - size * product, 0.0) / n
    return side * size, swing.noise / np.sqrt(stop.COSINE_VARIANCE * cell * n), misfit
