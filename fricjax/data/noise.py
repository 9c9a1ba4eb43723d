"""How fine a record is: its white noise and the step of its quantisation, read from the samples themselves.

A smooth motion sampled densely is, over a few neighbouring samples, a polynomial. A divided difference of high order
removes that polynomial and leaves only noise; its median is deaf to the few samples at reversals and glitches.
"""

import numpy as np

ORDERS = (2, 3, 4, 5, 6, 8)
NORMAL_MAD = 0.6744897501960817


def resolution(x: np.ndarray) -> float:
    """Smallest step of quantised data, or 0.0 where the values show no common step.

    The values of an encoder lie on a grid: where they are dense, the gaps between them are small multiples of one step
    (roughly, if a few decimals were written); where they are sparse, exact multiples of a fraction of the smallest gap.
    """
    levels = np.unique(x)
    gaps = np.diff(levels)
    gaps = np.sort(gaps[gaps > 1e-11 * max(np.ptp(x), np.abs(x).max())])
    if gaps.size < 10:
        return float(gaps[0]) if gaps.size and levels.size <= x.size // 4 else 0.0
    step = gaps[gaps < 1.5 * gaps[0]].mean()
    if _on_grid(gaps[gaps < 10.5 * step] / step, 0.15):
        return float(step)
    for divisor in range(1, 21):
        step = gaps[0] / divisor
        if _on_grid(gaps[:100] / step, 0.02):
            return float(step)
    return 0.0


def _on_grid(multiples: np.ndarray, tolerance: float) -> bool:
    return multiples.size >= 20 and float(np.mean(np.abs(multiples - np.round(multiples)) < tolerance)) > 0.95


def white_noise(t: np.ndarray, x: np.ndarray, step: float = 0.0) -> float:
    """Standard deviation of the white noise of `x`, at least what rounding to `step` causes (`step / sqrt(12)`).

    Args:
        t: times [s], shape `(n,)`, increasing, not necessarily evenly spaced.
        x: displacements, shape `(n,)`.
        step: the quantisation step of `x`, 0 for none.

    Returns:
        The smallest of the estimates from differences of several orders: what is left of the motion only adds to each.
    """
    rounding = step / np.sqrt(12.0)
    estimates = [_from_differences(t, x, order) for order in ORDERS if x.size >= order + 4]
    return float(max(min(estimates, default=0.0), rounding))


def _from_differences(t: np.ndarray, x: np.ndarray, order: int) -> float:
    """Median size of the divided differences of this order, scaled to the standard deviation of one sample."""
    size = x.size - order
    scaled = (t - t[0]) / np.median(np.diff(t))
    total, squares = np.zeros(size), np.zeros(size)
    for j in range(order + 1):
        weight = np.ones(size)
        for k in range(order + 1):
            if k != j:
                weight /= scaled[j : j + size] - scaled[k : k + size]
        total += weight * x[j : j + size]
        squares += weight**2
    return float(np.median(np.abs(total) / np.sqrt(squares)) / NORMAL_MAD)
