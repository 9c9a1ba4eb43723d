"""Are the residuals white? Standard errors assume it, and a wrong model, vibration or drift break it.

The integrated autocorrelation time tau says how many samples in a row carry the same information: standard errors of
slowly varying parameters are too small by about sqrt(tau), and by the square root of the reduced chi^2 beside it
where the noise was given (Sokal, 1996).
"""

from typing import NamedTuple

import numpy as np

_BLOCK = 1 << 17


class Whiteness(NamedTuple):
    """Verdict on the residuals.

    Attributes:
        lag_one: autocorrelation of neighbouring samples.
        correlation_time: integrated autocorrelation time in samples, one for white residuals.
        white: whether neighbouring samples are uncorrelated within four standard errors.
    """

    lag_one: float
    correlation_time: float
    white: bool


def whiteness(residuals: np.ndarray) -> Whiteness:
    """Judge a sequence of residuals, in the order of time and in units of their standard deviation."""
    n = residuals.size
    centred = residuals - residuals.mean() if np.all(np.isfinite(residuals)) else np.zeros(n)
    power = float(centred @ centred)
    if n < 8 or not power > 0:
        return Whiteness(0.0, 1.0, True)
    correlation = _autocorrelation(centred) / power
    pairs = correlation[1:-1:2] + correlation[2::2] if n >= 16 else correlation[1:2]
    ends = np.flatnonzero(pairs <= 2 / np.sqrt(n))
    positive = pairs[: ends[0]] if ends.size else pairs
    time = 1 + 2 * float(np.sum(np.minimum.accumulate(positive))) if positive.size else 1.0
    return Whiteness(float(correlation[1]), max(time, 1.0), bool(abs(correlation[1]) < 4 / np.sqrt(n)))


def _autocorrelation(centred: np.ndarray) -> np.ndarray:
    """Sums of products of samples some lag apart, for lags up to half the record or half a block of a long one.

    A long record is cut into blocks, so that the cost stays linear; products across their borders are left out.
    """
    from scipy.fft import next_fast_len

    length = min(centred.size, _BLOCK)
    blocks = np.pad(centred, (0, -centred.size % length)).reshape(-1, length)
    # So long that the lags do not wrap around.
    size = int(next_fast_len(length + length // 2, real=True) or 2 * length)
    spectrum = sum(np.abs(np.fft.rfft(block, size)) ** 2 for block in blocks)
    return np.fft.irfft(spectrum, size)[: length // 2]
