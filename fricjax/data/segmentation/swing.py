"""A trace made ready for the search of its reversals: its samples, smoothed ones, and the scales that matter.

The extremes between which it swings are found by hysteresis: they are those that a larger move follows.
"""

import dataclasses

import numpy as np

FEW = 256  # extremes that need no thinning out, which bounds the loop of `zigzag` in Python
# Median deviations from which a sample is a spike, samples in a half-cycle from which that can be said, and the part of
# a record that spikes may be, each with its neighbours: beyond it they are its noise.
SPIKE, DENSE, FEW_SPIKES = 12.0, 48, 0.1


@dataclasses.dataclass(frozen=True)
class Swing:
    """Samples of a decay with the scales of its noise and its time.

    **Fields:**

    - `t`, `x`: times [s] and positions of the used samples, shape `(n,)`; `smoothed`: positions with less noise.
    - `noise`: standard deviation of `x`; `resolution`: step of its quantisation, 0 for none.
    - `threshold`: the smallest motion before the first large half-cycle that counts as one.
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
        """Distance between two samples."""
        return float(abs(self.smoothed[end] - self.smoothed[begin]))


def without_spikes(x: np.ndarray, noise: float, stretch: int) -> np.ndarray:
    """The record with samples far off their neighbours replaced by the line between those about them.

    Args:
        x: positions, shape `(n,)`.
        noise: standard deviation of a sample at least.
        stretch: samples of a half-cycle, to whose median deviation one is compared.
    """
    if stretch < DENSE or x.size < 2 * stretch:
        return x
    off = x[:-2] + x[2:]
    off *= -0.5
    off += x[1:-1]
    np.abs(off, out=off)
    number = off.size // stretch
    usual = np.median(off[: number * stretch].reshape(number, stretch), axis=1)
    # A motion that starts or ends within a stretch is curved as in the next one.
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

    The first is the pole from which the motion starts, the last the farthest point of the half-cycle still open at the
    end; the ones between are reversals. A trace that never moves by more than `threshold` gives an empty list. `among`
    holds its `extremes` for this threshold or a smaller one.
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
