"""Preparation of a trace, and the search for its extremes.

A `PreparedTrace` holds the samples, the smoothed samples and the scales of noise and time. An extreme is a reversal if
a move larger than a threshold follows it.
"""

import dataclasses

import numpy as np

PIECE = 1 << 16  # samples that are processed at once
FEW = 256  # extremes that need no thinning; this bounds the Python loop of `zigzag`
# Size of a spike in median deviations, fewest samples per half-cycle for the spike test, and largest share of spikes in
# a record; a larger share is noise.
SPIKE, DENSE, FEW_SPIKES = 12.0, 48, 0.1


@dataclasses.dataclass(frozen=True)
class PreparedTrace:
    """Samples of a decay with the scales of noise and time.

    **Fields:**

    - `t`, `x`: times [s] and positions of the used samples, shape `(n,)`; `smoothed`: smoothed positions.
    - `noise`: standard deviation of `x`; `resolution`: quantisation step, 0 for none.
    - `threshold`: the smallest motion that counts before the first large half-cycle.
    - `half_period`: typical duration of a half-cycle [s]; `interval`: typical time between samples [s].
    """

    t: np.ndarray
    x: np.ndarray
    smoothed: np.ndarray
    noise: float
    resolution: float
    threshold: float
    half_period: float
    interval: float

    def distance(self, begin: int, end: int) -> float:
        """Return the distance between two samples."""
        return float(abs(self.smoothed[end] - self.smoothed[begin]))


def without_spikes(t: np.ndarray, x: np.ndarray, noise: float, interval: float, stretch: int) -> np.ndarray:
    """Replace spikes by linear interpolation between their neighbours.

    Args:
        t: times [s], shape `(n,)`.
        x: positions, shape `(n,)`.
        noise: lower bound of the standard deviation of a sample.
        interval: typical time between samples [s].
        stretch: samples per half-cycle; a spike is compared with the median deviation in such a stretch.
    """
    if stretch < DENSE or x.size < 2 * stretch:
        return x
    # Deviation from the line through both neighbours, in pieces that bound the memory.
    off = np.empty(x.size - 2)
    for first in range(0, off.size, PIECE):
        part = slice(first, min(first + PIECE, off.size) + 2)
        steps, moves = np.diff(t[part]), np.diff(x[part])
        off[first : first + PIECE] = np.abs(moves[:-1] * steps[1:] - moves[1:] * steps[:-1]) / (steps[:-1] + steps[1:])
    number = off.size // stretch
    usual = np.median(off[: number * stretch].reshape(number, stretch), axis=1)
    # A motion that starts or ends within a stretch is as curved as in the next stretch.
    usual = np.maximum(usual, np.maximum(np.append(usual[1:], 0.0), np.insert(usual[:-1], 0, 0.0)))
    bound = SPIKE * np.maximum(usual, noise)
    above = off[: number * stretch].reshape(number, stretch) > bound[:, None]
    spikes = np.flatnonzero(np.append(above, off[number * stretch :] > bound[-1]))
    # The deviation of a curved motion grows with the product of both intervals.
    curved = (t[spikes + 1] - t[spikes]) * (t[spikes + 2] - t[spikes + 1]) / interval**2
    spikes = 1 + spikes[off[spikes] > SPIKE * usual[np.minimum(spikes // stretch, number - 1)] * curved]
    if not spikes.size or spikes.size > FEW_SPIKES * x.size:
        return x
    kept = np.ones(x.size, dtype=bool)
    kept[spikes] = False
    return np.where(kept, x, np.interp(t, t[kept], x[kept]))


def smooth(t: np.ndarray, x: np.ndarray, width: int, interval: float) -> np.ndarray:
    """Return the moving average over `width` typical intervals (made odd).

    The window shrinks towards both ends. A median of three removes single outliers before. An average belongs to the
    mean time of its window, which lies off the middle near a gap.
    """
    if min(width, x.size) < 3:
        return x
    filtered, smoothed = x.copy(), np.empty_like(x)
    np.minimum(np.maximum(x[:-2], x[1:-1]), x[2:], out=filtered[1:-1])
    np.maximum(np.minimum(x[:-2], x[1:-1]), filtered[1:-1], out=filtered[1:-1])
    longest = (width // 2 + 0.5) * interval
    # Each piece includes one more sample on both sides, so that the averages can be interpolated.
    for first in range(0, x.size, PIECE):
        inner = slice(max(first - 1, 0), first + PIECE + 1)
        ends = np.searchsorted(t, [t[inner][0] - longest, t[inner][-1] + longest])
        near, at = t[slice(*ends)] - t[first], t[inner] - t[first]
        reach = np.minimum(longest, np.minimum(t[inner] - t[0], t[-1] - t[inner]) + 0.5 * interval)
        low, high = np.searchsorted(near, at - reach), np.searchsorted(near, at + reach)
        values = filtered[slice(*ends)]
        level = values.mean()
        places, averages = (
            (sums[high] - sums[low]) / (high - low)
            for sums in (np.concatenate([[0.0], np.cumsum(each)]) for each in (near, values - level))
        )
        smoothed[first : first + PIECE] = level + np.interp(at[first - inner.start :][:PIECE], places, averages)
    return smoothed


def extremes(x: np.ndarray, threshold: float) -> np.ndarray:
    """Return indices of local extremes and both ends, with small details removed.

    A move of at most `threshold` that lies within both neighbouring moves is a detail of a larger move. All such moves
    are removed at once, and this repeats while it removes many. No move above `threshold` is lost.
    """
    rises = x[1:] > x[:-1]
    moves = np.flatnonzero(rises | (x[1:] < x[:-1]))
    upward = rises[moves]
    index = np.concatenate([[0], moves[1:][upward[1:] != upward[:-1]], [x.size - 1]])
    while index.size > FEW:
        sizes = np.abs(np.diff(x[index]))
        inner = sizes[1:-1]
        details = 1 + np.flatnonzero((inner <= threshold) & (inner <= sizes[:-2]) & (inner < sizes[2:]))
        if details.size < 0.01 * index.size:
            break
        kept = np.ones(index.size, dtype=bool)
        kept[details] = kept[details + 1] = False
        index = index[kept]
    return index


def zigzag(x: np.ndarray, among: np.ndarray, threshold: float) -> list[int]:
    """Return indices of alternating extremes with moves of `x` above `threshold`.

    The first index is the pole from which the motion starts. The last index is the farthest point of the half-cycle
    that is still incomplete at the end; the others are reversals. The list is empty if no move exceeds `threshold`.
    `among` contains the `extremes` for this threshold or a smaller one.
    """
    pivots: list[int] = []
    high = low = (float(x[0]), 0)
    direction = 0
    for value, i in zip(x[among].tolist(), among.tolist(), strict=True):
        if value > high[0]:
            high = (value, i)
        if value < low[0]:
            low = (value, i)
        if direction >= 0 and high[0] - value > threshold:
            pivots.append(high[1])
            direction, low, high = -1, (value, i), (value, i)
        elif direction <= 0 and value - low[0] > threshold:
            pivots.append(low[1])
            direction, low, high = 1, (value, i), (value, i)
    return [*pivots, high[1] if direction > 0 else low[1]] if pivots else []
