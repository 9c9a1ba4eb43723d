"""White noise and quantisation step, estimated from the samples.

Over a few neighbouring samples a smooth, densely sampled motion is a polynomial. A divided difference of high order
removes this polynomial and leaves only noise. The median of the differences ignores the few samples at reversals and
glitches. For long records, evenly spread blocks of neighbouring samples suffice.
"""

import numpy as np

# Orders of the differences. A remainder of the motion only increases an estimate, so the smallest estimate counts.
ORDERS = (2, 3, 4, 5, 6, 8)
NORMAL_MAD = 0.6744897501960817
"""Median absolute deviation of a normal distribution of standard deviation one."""
ENOUGH = 2**17  # samples that give the noise to about 1 %
SOME = 2**11  # samples that give the typical interval
BLOCKS = 32


def blocks(values: np.ndarray, enough: int = ENOUGH) -> np.ndarray:
    """Return contiguous blocks of a record, shape `(b, m)`.

    A short record is one block; otherwise the blocks hold `enough` samples in total.
    """
    if values.size <= enough:
        return values[None]
    length = enough // BLOCKS
    starts = np.linspace(0, values.size - length, BLOCKS).astype(int)
    return np.lib.stride_tricks.sliding_window_view(values, length)[starts]


def typical_interval(t: np.ndarray) -> float:
    """Return the typical time between samples [s]."""
    return median(np.diff(blocks(t, SOME)))


def median(values: np.ndarray) -> float:
    """Return the median, or the upper median of an even count.

    It is several times faster than numpy's median, which also searches for NaN.
    """
    half = values.size // 2
    return float(np.partition(values, half, axis=None)[half])


def line_fit(t: np.ndarray, x: np.ndarray) -> tuple[float, np.ndarray]:
    """Fit a straight line; return slope and residuals, shape `(n,)`."""
    u, y = t - t.mean(), x - x.mean()
    slope = (u @ y) / (u @ u)
    return float(slope), y - slope * u


def resolution(x: np.ndarray) -> float:
    """Return the step of quantised data, or 0.0 for none.

    The values of an encoder lie on a grid. If they are dense, the gaps between them are small multiples of one step (to
    rounding, if the file has few decimals). If they are sparse, the gaps are exact multiples of a fraction of the
    smallest gap.
    """
    x = np.sort(blocks(x), axis=None)
    gaps, rounding = np.diff(x), 1e-11 * max(x[-1] - x[0], x[-1], -x[0])
    levels = 1 + np.count_nonzero(gaps)
    gaps = gaps[gaps > rounding]
    least = gaps.min(initial=np.inf)
    # Gaps of all sizes down to the rounding come from noise, not from steps.
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


def white_noise(t: np.ndarray, x: np.ndarray, step: float = 0.0, kinks: np.ndarray | None = None) -> float:
    """Estimate the standard deviation of the white noise of `x`.

    The result is at least the rounding noise `step / sqrt(12)`.

    Args:
        t: times [s], shape `(n,)`, increasing, not necessarily evenly spaced.
        x: displacements, shape `(n,)`.
        step: the quantisation step of `x`, 0 for none.
        kinks: times at which the motion is not smooth [s]: the reversals. Differences across them are left out of
            short records; in long ones they are few.

    Returns:
        The smallest estimate from differences of several orders. A remainder of the motion only increases an estimate.
    """
    places = np.empty(0, int) if kinks is None or x.size > ENOUGH else np.searchsorted(t, kinks)
    estimates = _estimates(blocks(t) / typical_interval(t), blocks(x), places)
    return float(max(min(estimates, default=0.0), step / np.sqrt(12.0)))


def _estimates(t: np.ndarray, x: np.ndarray, kinks: np.ndarray) -> list[float]:
    """Estimate the noise from the divided differences of each order.

    Each estimate is the median size, scaled to the standard deviation of one sample. Differences of samples on both
    sides of one of the indices `kinks` are left out if enough others remain.
    """
    estimates, differences = [], x
    # Evenly spaced samples share the weights of the first samples.
    even = float(np.ptp(np.diff(t))) < 1e-3
    places = t[:1, : 2 * ORDERS[-1]] if even else t
    weights = np.ones((1, *places.shape))
    for order in range(1, min(ORDERS[-1], x.shape[-1] - 4) + 1):
        differences = np.diff(differences) / (t[:, order:] - t[:, :-order])
        # Neighbouring weights have opposite signs, so their sizes add up in a difference. Only the sizes matter.
        grown = np.zeros((order + 1, places.shape[0], places.shape[1] - order))
        grown[1:] += weights[..., 1:]
        grown[:-1] += weights[..., :-1]
        weights = grown / (places[:, order:] - places[:, :-order])
        if order in ORDERS:
            norm = np.sqrt(np.einsum("kbm,kbm->bm", weights, weights))
            sizes = np.abs(differences) / (norm[0, 0] if even else norm)
            if kinks.size:
                across = np.unique(np.clip(kinks[:, None] - np.arange(1, order + 1), 0, sizes.size - 1))
                if across.size < sizes.size // 2:
                    sizes = np.delete(sizes.ravel(), across)
            estimates.append(median(sizes) / NORMAL_MAD)
    return estimates
