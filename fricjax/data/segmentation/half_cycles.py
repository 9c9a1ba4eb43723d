"""The half-cycles of a decay, tracked by their period and their decrease.

A threshold on neighbouring samples cannot distinguish a half-cycle from instrument noise, which is coloured, hums and
is rounded. The regularity of a decay can: the large half-cycles give the half-period, and from there on the period
predicts each reversal. In every further half-period of the record a half-cosine is fitted in the expected direction.
`stop` then determines how many of them are motion.
"""

from typing import NamedTuple

import numpy as np

from . import stop
from .swing import PreparedTrace, extremes, zigzag

# A factor of two in either direction changes no count in `tests/data`, and changes mu by a fraction of its standard
# error in `experiments/honesty/run.py --thresholds`. No threshold here or in `stop` is tuned closely.
# Share of the span above which a half-cycle is accepted without its period; far above any useful noise level.
SURE = 0.1
# Search range about a predicted reversal, and largest accepted deviation from the prediction, in half-periods.
SOUGHT, BELIEVED = 0.2, 0.12
# Size relative to the previous half-cycle below which a half-cycle is the last one that adjusts the prediction.
TINY = 0.02
# Half-cycles from the pole on that may last any time, because a hand may guide or hold the mass.
STEADY = 3
# Standard errors above which the period depends on the amplitude, and fewest durations that can show this.
ISOCHRONOUS, DURATIONS = 4.0, 6
# Largest ratio between the durations of small and typical half-cycles. A pendulum's small half-cycles last half as long
# as those from near its top. Convention.
FOLDS = 4.0
# Averages per half-cycle for the fit of its size.
PER_HALF_CYCLE = 256


class HalfCycles(NamedTuple):
    """The half-cycles of a record.

    **Fields:**

    - `edges`: times between which they lie [s], shape `(n + 1,)`: the pole at the start, the reversals, and the stop if
      there is one.
    - `stopped`: True if the mass comes to rest; False if the record ends in motion.
    - `open`: other possible numbers of half-cycles.
    """

    edges: np.ndarray
    stopped: bool
    open: tuple[int, ...]


def find_half_cycles(trace: PreparedTrace, visible: float) -> HalfCycles | None:
    """Find the half-cycles of a record.

    Args:
        trace: the prepared trace.
        visible: upper bound of the span of the noise after smoothing.

    Returns:
        The half-cycles; None if the mass never moves.
    """
    share = max(SURE * float(np.ptp(trace.smoothed)), visible)
    pivots = zigzag(trace.smoothed, extremes(trace.smoothed, share), share)
    if not pivots:
        return None
    edges = _detect_large_half_cycles(trace, pivots)
    if edges.size < 2:
        return HalfCycles(edges, False, ())
    # If a record holds several decays, the trend of the durations may lead to zero or below.
    period = float(np.clip(_small_period(trace, edges), trace.half_period / FOLDS, trace.half_period * FOLDS))
    large = edges.size - 1
    side = float(np.sign(np.subtract(*np.interp(edges[[-1, -2]], trace.t, trace.smoothed))))
    edges = _track_by_period(trace, edges, side, period)
    size, error, misfit = _half_cycle_amplitudes(trace, edges, side * (-1.0) ** (np.arange(edges.size - 1) - large + 1))
    number, stopped, others = stop.find_stop(trace, edges, size, error, misfit, large)
    return HalfCycles(edges[: number + 1], stopped, others)


def _detect_large_half_cycles(trace: PreparedTrace, pivots: list[int]) -> np.ndarray:
    """Return the times of pole and reversals between large half-cycles.

    Reversals within gaps of the samples are filled in.
    """
    t = trace.t
    if len(pivots) == 2:
        # A single half-cycle: the mass may be held before it or creep after it, so its middle is most reliable.
        begin, end = pivots
        way = np.abs(trace.smoothed[begin : end + 1] - trace.smoothed[begin])
        middle = float(t[begin + int(np.argmax(way >= 0.5 * way[-1]))])
        edges = middle + 0.5 * trace.half_period * np.array([-1.0, 1.0])
        return np.maximum(edges, t[0])[: 2 if edges[1] + stop.SHORTEST_REST * trace.half_period <= t[-1] else 1]
    edges = t[pivots[:-1]]
    if edges.size > 1:
        side = float(np.sign(np.subtract(*trace.smoothed[[pivots[-2], pivots[-3]]])))
        last = _reversal(trace, float(edges[-1]), trace.half_period, side)
        # A spike near a reversal can appear as a further reversal, and the parabola then leads before the previous one.
        edges[-1] = last if last > edges[-2] else edges[-1]
    # Near the smallest size some half-cycles are detected and others missed. Continue from the first missed one.
    missed = np.flatnonzero(np.diff(edges)[STEADY:] > 2 * np.diff(edges)[STEADY - 1 : -1])
    edges = edges[: STEADY + 1 + int(missed[0])] if missed.size else edges
    edges = _moved_into_gaps(trace, edges)
    gaps = np.flatnonzero(np.diff(t) > 0.5 * trace.half_period)
    hidden = np.searchsorted(edges, t[gaps])
    # Across a gap in a hold, the mass does not move.
    still = np.abs(trace.smoothed[gaps + 1] - trace.smoothed[gaps]) < trace.threshold
    hidden = hidden[(hidden > 1) | ~still]
    for i in np.unique(hidden[(hidden > 0) & (hidden < edges.size)])[::-1]:
        # Extremes alternate, so the number of missing ones is even.
        missing = 2 * round(float((edges[i] - edges[i - 1]) / trace.half_period - 1) / 2)
        edges = np.insert(edges, i, np.linspace(edges[i - 1], edges[i], missing + 2)[1:-1])
    return edges


def _moved_into_gaps(trace: PreparedTrace, edges: np.ndarray) -> np.ndarray:
    """Move reversals at the edge of a gap to their predicted times.

    The farthest sample lies at the edge if the reversal itself is missing.
    """
    t, half_period = trace.t, trace.half_period
    gaps = np.flatnonzero(np.diff(t) > SOUGHT * half_period)
    if not gaps.size or edges.size < 3:
        return edges
    ends, near = np.concatenate([t[gaps], t[gaps + 1]]), 0.5 * SOUGHT * half_period
    hidden = np.min(np.abs(edges[:, None] - ends), axis=1) < near
    edges = edges.copy()
    for i in np.flatnonzero(hidden[1:]) + 1:
        after = edges[i + 1] if i + 1 < edges.size else np.inf
        by_next = after - half_period if i + 1 < edges.size and not hidden[i + 1] else -np.inf
        predicted = by_next if by_next > edges[i - 1] else edges[i - 1] + half_period
        edges[i] = predicted if predicted < after else edges[i]
    return edges


def _small_period(trace: PreparedTrace, edges: np.ndarray) -> float:
    """Return the duration of the half-cycles after the detected ones [s].

    It is the mean duration, or the last one if the duration varies with the size.
    """
    durations = np.diff(edges)[1:] if edges.size > 2 else np.array([trace.half_period])
    at = np.interp(edges, trace.t, trace.smoothed)
    weight = np.abs(np.diff(at))[-durations.size :]
    mean = float(np.average(durations, weights=weight**2))
    if durations.size < DURATIONS:
        return mean
    # To first order the period of a pendulum depends on the square of its amplitude.
    square = weight**2 - np.average(weight**2, weights=weight**2)
    slope = np.sum(weight**2 * square * durations) / np.sum(weight**2 * square**2)
    residual = durations - mean - slope * square
    slope_error = np.sqrt(np.sum(weight**2 * residual**2) / (durations.size - 2) / np.sum(weight**2 * square**2))
    return float(mean + slope * square[-1]) if abs(slope) > ISOCHRONOUS * slope_error else mean


def _track_by_period(trace: PreparedTrace, edges: np.ndarray, side: float, period: float) -> np.ndarray:
    """Append the predicted reversals up to the end of the record.

    Each is moved to its extreme; without an extreme nearby, as at rest, the prediction is kept.
    """
    t, x, times = trace.t, trace.smoothed, list(edges)
    places = np.interp(edges, t, x).tolist()
    while times[-1] + period <= t[-1]:
        at, side = times[-1] + period, -side
        # Below this size half-cycles cannot be tracked, and wiggles at rest must not shift the prediction.
        if abs(np.interp(at, t, x) - places[-1]) < TINY * abs(places[-1] - places[-2]):
            break
        times.append(_reversal(trace, at, period, side))
        places.append(float(np.interp(times[-1], t, x)))
    left = max(int((t[-1] - times[-1]) / period), 0)
    return np.append(times, times[-1] + period * np.arange(1, left + 1))


def _reversal(trace: PreparedTrace, at: float, period: float, side: float) -> float:
    """Return the extreme nearest a predicted time [s].

    It is a maximum for a positive `side`. Without an extreme nearby, the prediction is returned.
    """
    t, x, reach = trace.t, trace.smoothed, SOUGHT * period
    near = slice(*np.searchsorted(t, [at - reach, at + reach]))
    every = (near.stop - near.start) // 128 + 1
    u, y = (t[near][::every] - at) / reach, x[near][::every]
    # Samples on one side only do not show an extreme.
    if u.size < 5 or u[0] > -0.5 or (u[-1] < 0.5 and t[-1] > at + reach):
        return at
    y, square = y - y.mean(), u * u
    # Least squares fit of a parabola; the times are spread about evenly on both sides.
    slope = float(u @ y) / float(square.sum())
    square -= square.mean()
    curve = float(square @ y) / float(square @ square)
    shift = -slope / (2 * curve) if side * curve < 0 else np.inf
    # With friction the curvature at a reversal is proportional to the half-cycle on each side, so a parabola is late:
    # by 3/8 of the reach (mean of |u|^3 over twice the mean of u^2), times the sizes' difference over their sum.
    here, before, after = np.interp([at, at - period, at + period], t, x)
    seen = 0.5 - 0.5 * np.cos(np.pi * np.clip((t[-1] - at) / period, SOUGHT, 1.0))
    sizes = abs(here - before), abs(after - here) / seen
    shift -= 0.375 * np.subtract(*sizes) / max(np.sum(sizes), trace.threshold)
    return at + reach * shift if abs(shift) * SOUGHT <= BELIEVED else at


def _half_cycle_amplitudes(
    trace: PreparedTrace, edges: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit a half-cosine in each half-cycle.

    Returns its size, the standard error of the size for white noise, and the residual variance.
    """
    cell = int(trace.half_period / trace.interval) // PER_HALF_CYCLE + 1
    t, x = trace.t, trace.x
    if cell > 1:
        cells = (t - (t[0] - 0.5 * trace.interval)) // (cell * trace.interval)
        starts = np.append(0, 1 + np.flatnonzero(cells[1:] != cells[:-1]))
        t, x = (np.add.reduceat(values, starts) / np.diff(starts, append=cells.size) for values in (t, x))
    places, samples = np.searchsorted(t, edges), np.diff(np.searchsorted(trace.t, edges))
    count = np.diff(places).astype(float)
    used = slice(places[0], places[-1])
    number = np.repeat(np.arange(count.size), np.diff(places))
    t, x = t[used], x[used] - x[used].mean()
    shape = 0.5 - 0.5 * np.cos(np.pi * (t - edges[number]) / (edges[number + 1] - edges[number]))

    def sums(values: np.ndarray) -> np.ndarray:
        return np.bincount(number, values, minlength=count.size)

    # Linear regression of x on the half-cosine, for all half-cycles at once.
    n = np.maximum(count, 1.0)
    mean_shape, mean_x = sums(shape) / n, sums(x) / n
    h, y = shape - mean_shape[number], x - mean_x[number]
    square, product = sums(h * h), sums(h * y)
    resolved = (count >= 4) & (square > 0.02 * count)
    size = np.where(resolved, product / np.where(resolved, square, 1.0), 0.0)
    misfit = np.maximum(sums(y * y) - size * product, 0.0) / n
    return side * size, trace.noise / np.sqrt(stop.COSINE_VARIANCE * np.maximum(samples, 1)), misfit
