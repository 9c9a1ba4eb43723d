"""Preparation of a trace, and the search for its extremes.

A `PreparedTrace` holds the samples, the smoothed samples and the scales of noise and time. An extreme is a reversal if
a move larger than a threshold follows it.
"""

import dataclasses

import numpy as np

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


def without_spikes(x: np.ndarray, noise: float, stretch: int) -> np.ndarray:
    """Replace spikes by linear interpolation between their neighbours.

    Args:
        x: positions, shape `(n,)`.
        noise: lower bound of the standard deviation of a sample.
        stretch: samples per half-cycle; a spike is compared with the median deviation in such a stretch.
    """
    if stretch < DENSE or x.size < 2 * stretch:
        return x
    off = x[:-2] + x[2:]
    off *= -0.5
    off += x[1:-1]
    np.abs(off, out=off)
    number = off.size // stretch
    usual = np.median(off[: number * stretch].reshape(number, stretch), axis=1)
    # A motion that starts or ends within a stretch is as curved as in the next stretch.
    usual = np.maximum(usual, np.maximum(np.append(usual[1:], 0.0), np.insert(usual[:-1], 0, 0.0)))
    bound = SPIKE * np.maximum(usual, noise)
    above = off[: number * stretch].reshape(number, stretch) > bound[:, None]
    spikes = 1 + np.flatnonzero(np.append(above, off[number * stretch :] > bound[-1]))
    if not spikes.size or spikes.size > FEW_SPIKES * x.size:
        return x
    kept = np.ones(x.size, dtype=bool)
    kept[spikes] = False
    places = np.arange(x.size)
    return np.where(kept, x, np.interp(places, places[kept], x[kept]))


def smooth(x: np.ndarray, width: int) -> np.ndarray:
    """Return the moving average over `width` samples (made odd).

    The window shrinks towards both ends. A median of three removes single outliers before.
    """
    if min(width, x.size) < 3:
        return x
    half = min(width // 2, (x.size - 1) // 2)
    sums, mean = np.zeros(x.size + 1), x.mean()
    inner = sums[2:-1]
    np.minimum(np.maximum(x[:-2], x[1:-1]), x[2:], out=inner)
    np.maximum(np.minimum(x[:-2], x[1:-1]), inner, out=inner)
    sums[1], sums[-1] = x[0], x[-1]
    sums[1:] -= mean
    np.cumsum(sums, out=sums)
    smoothed = np.empty_like(x)
    smoothed[half : x.size - half] = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    widths = 2 * np.arange(half) + 1
    smoothed[:half] = sums[widths] / widths
    smoothed[x.size - half :] = ((sums[-1] - sums[-1 - widths]) / widths)[::-1]
    smoothed += mean
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
