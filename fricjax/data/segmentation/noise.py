"""How fine a record is: its white noise and the step of its quantisation, read from the samples themselves.

A smooth motion sampled densely is, over a few neighbouring samples, a polynomial. A divided difference of high order
removes that polynomial and leaves only noise; its median is deaf to the few samples at reversals and glitches.
Of a long record evenly spread blocks of neighbouring samples are taken: more of them would add nothing.
"""

import numpy as np

# Of the differences: what is left of the motion only adds to an estimate, so that the smallest counts.
ORDERS = (2, 3, 4, 5, 6, 8)
NORMAL_MAD = 0.6744897501960817
"""Median absolute deviation of a normal distribution of standard deviation one."""
ENOUGH = 2**17  # samples, which give the noise to about 1 %
SOME = 2**11  # samples, enough for the typical time between them
BLOCKS = 32


def blocks(values: np.ndarray, enough: int = ENOUGH) -> np.ndarray:
    """Contiguous blocks of a record, shape `(b, m)`: all of a short one as one block, else `enough` samples of it."""
    if values.size <= enough:
        return values[None]
    length = enough // BLOCKS
    starts = np.linspace(0, values.size - length, BLOCKS).astype(int)
    return np.lib.stride_tricks.sliding_window_view(values, length)[starts]


def typical_interval(t: np.ndarray) -> float:
    """Typical time between samples [s]."""
    return median(np.diff(blocks(t, SOME)))


def median(values: np.ndarray) -> float:
    """The median, the upper one of two; several times faster than that of NumPy, which also looks for NaN."""
    half = values.size // 2
    return float(np.partition(values, half, axis=None)[half])


def line_fit(t: np.ndarray, x: np.ndarray) -> tuple[float, np.ndarray]:
    """Slope of the straight line of least squares, and what it leaves of `x`, shape `(n,)`."""
    u, y = t - t.mean(), x - x.mean()
    slope = (u @ y) / (u @ u)
    return float(slope), y - slope * u


def resolution(x: np.ndarray) -> float:
    """Smallest step of quantised data, or 0.0 where the values show no common step.

    The values of an encoder lie on a grid: where they are dense, the gaps between them are small multiples of one step
    (roughly, if a few decimals were written); where they are sparse, exact multiples of a fraction of the smallest gap.
    """
    x = np.sort(blocks(x), axis=None)
    gaps, rounding = np.diff(x), 1e-11 * max(x[-1] - x[0], x[-1], -x[0])
    levels = 1 + np.count_nonzero(gaps)
    gaps = gaps[gaps > rounding]
    least = gaps.min(initial=np.inf)
    # Gaps of all sizes down to the rounding are those of noise, not of steps.
    if least < 1.5 * rounding:
        return 0.0
    if gaps.size < 10:
        return float(least) if gaps.size and levels <= x.size // 4 else 0.0
    step = gaps[gaps < 1.5 * least].mean()
    if _on_grid(gaps[gaps < 10.5 * step] / step, 0.15):
        return float(step)
    smallest = np.partition(gaps, 99)[:100] if gaps.size > 100 else gaps
    steps = least / np.arange(1, 21)
    fitting = np.flatnonzero(_on_grid(smallest / steps[:, None], 0.02))
    return float(steps[fitting[0]]) if fitting.size else 0.0


def _on_grid(multiples: np.ndarray, tolerance: float) -> np.ndarray:
    near = np.mean(np.abs(multiples - np.round(multiples)) < tolerance, axis=-1)
    return (multiples.shape[-1] >= 20) & (near > 0.95)


def white_noise(t: np.ndarray, x: np.ndarray, step: float = 0.0) -> float:
    """Standard deviation of the white noise of `x`, at least what rounding to `step` causes (`step / sqrt(12)`).

    Args:
        t: times [s], shape `(n,)`, increasing, not necessarily evenly spaced.
        x: displacements, shape `(n,)`.
        step: the quantisation step of `x`, 0 for none.

    Returns:
        The smallest of the estimates from differences of several orders: what is left of the motion only adds to each.
    """
    estimates = _estimates(blocks(t) / typical_interval(t), blocks(x))
    return float(max(min(estimates, default=0.0), step / np.sqrt(12.0)))


def _estimates(t: np.ndarray, x: np.ndarray) -> list[float]:
    """Median size of the divided differences of each order, scaled to the standard deviation of one sample."""
    estimates, differences = [], x
    # Evenly spaced samples share the weights of the first ones.
    even = float(np.ptp(np.diff(t))) < 1e-3
    places = t[:1, : 2 * ORDERS[-1]] if even else t
    weights = np.ones((1, *places.shape))
    for order in range(1, min(ORDERS[-1], x.shape[-1] - 4) + 1):
        differences = np.diff(differences) / (t[:, order:] - t[:, :-order])
        # Neighbouring weights have opposite signs: in their difference the sizes, all that is needed here, add up.
        grown = np.zeros((order + 1, places.shape[0], places.shape[1] - order))
        grown[1:] += weights[..., 1:]
        grown[:-1] += weights[..., :-1]
        weights = grown / (places[:, order:] - places[:, :-order])
        if order in ORDERS:
            norm = np.sqrt(np.einsum("kbm,kbm->bm", weights, weights))
            sizes = np.abs(differences) / (norm[0, 0] if even else norm)
            estimates.append(median(sizes) / NORMAL_MAD)
    return estimates
