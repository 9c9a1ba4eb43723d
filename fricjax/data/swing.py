"""A trace made ready for the search of its reversals: its samples, smoothed ones, and the scales that matter.

The extremes between which it swings are found by hysteresis: they are those that a larger move follows.
"""

import dataclasses

import numpy as np

FEW = 256  # extremes that need no thinning out


@dataclasses.dataclass(frozen=True)
class Swing:
    """Samples of a decay with the scales of its noise and its time.

    **Fields:**

    - `t`, `x`: times [s] and positions of the used samples, shape `(n,)`; `smoothed`: positions with less noise.
    - `noise`: standard deviation of `x`; `threshold`: the smallest motion that counts as one.
    - `half_period`: typical duration of a stroke [s]; `interval`: typical time between samples [s].
    """

    t: np.ndarray
    x: np.ndarray
    smoothed: np.ndarray
    noise: float
    threshold: float
    half_period: float
    interval: float

    def moved(self, begin: int, end: int, share: float) -> float:
        """Displacement, in the direction from sample `begin` to `end`, a share of the half-period after `begin`."""
        place = min(int(np.searchsorted(self.t, self.t[begin] + share * self.half_period)), self.x.size - 1)
        return float((self.smoothed[place] - self.smoothed[begin]) * np.sign(self.smoothed[end] - self.smoothed[begin]))

    def stroke(self, begin: int, end: int) -> float:
        """Distance between two samples."""
        return float(abs(self.smoothed[end] - self.smoothed[begin]))


def smooth(x: np.ndarray, width: int) -> np.ndarray:
    """Moving average over `width` samples (made odd), shorter towards both ends; a lone outlier is taken out before."""
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
    """Indices of the local extremes and of both ends, without most of those that no move above `threshold` hangs on.

    A move of at most `threshold` that lies within both its neighbours is a detail of a larger one. All such moves are
    left out at once, again and again, while that removes many.
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
    """Indices of alternating extremes between which `x` moves by more than `threshold`.

    The first is the pole from which the motion starts, the last the farthest point of the stroke still open at the end;
    the ones between are reversals. A trace that never moves by more than `threshold` gives an empty list. `among` holds
    its `extremes` for this threshold or a smaller one.
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
