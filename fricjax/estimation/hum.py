"""Hum in the noise of a series: spectral lines and their waves."""

import functools
from collections.abc import Iterable, Sequence

import numpy as np

from ..numbers import fast_length

# Power of a line relative to the median of its neighbours; white noise exceeds it at one of 10^9 frequencies.
_LINE = 30.0
# Neighbouring frequencies on either side, the half-width of a line under Hann's window, and the maximum number of
# lines.
_NEAR, _WIDE, _LINES = 24, 3, 3
# Gauss-Newton steps for the frequency of a line, starting within a tenth of the resolution.
_TUNINGS = 3


def waves_of(t: np.ndarray, unit: np.ndarray, lines: Iterable[float]) -> np.ndarray:
    """Return cosine and sine of each line [Hz], averaged over each row.

    Shape (n, 2 lines).
    """
    row = _interval(t)
    waves = [np.sinc(line * row) * f(2 * np.pi * line * t) for line in lines for f in (np.cos, np.sin)]
    return np.column_stack(waves) * unit[:, None]


def _interval(t: np.ndarray) -> float:
    """Return the median time between rows [s]."""
    return float(np.median(np.diff(t)))


@functools.lru_cache(maxsize=16)
def _window(n: int) -> np.ndarray:
    return np.hanning(n)


def lines_of(t: np.ndarray, unit: np.ndarray, residual: np.ndarray, motion: float) -> tuple[float, ...]:
    """Detect lines in the spectrum of residuals; return frequencies [Hz], strongest first.

    Args:
        t: times of the rows [s], shape (n,).
        unit: effect of a unit of the reading on each row, shape (n,).
        residual: residuals of the rows, shape (n,).
        motion: frequency of the motion [Hz]; lines near it are ignored.
    """
    left, lines = residual, list[float]()
    if left.size < 4 * _NEAR:
        return ()
    for _ in range(_LINES):
        line = _strongest(t, left, motion)
        if line is None or any(abs(line - other) * np.ptp(t) < _WIDE for other in lines):
            break
        lines, left = _tuned(t, unit, [*lines, line], residual)
    return tuple(lines)


def _strongest(t: np.ndarray, left: np.ndarray, motion: float) -> float | None:
    """Return the frequency of the strongest line, None if insignificant.

    A parabola through the log power gives the frequency to a fraction of the resolution.
    """
    size = fast_length(left.size)
    power = np.abs(np.fft.rfft(left * _window(left.size), size)) ** 2
    step = 1 / (size * _interval(t))
    # Near the motion a line indicates a model error, and the lowest frequencies are drift.
    apart = np.abs(step * np.arange(power.size) - motion) >= motion / 2
    apart[:_WIDE] = False
    k = int(np.argmax(power * apart))
    near = np.r_[max(k - _NEAR, 1) : max(k - _WIDE, 1), k + _WIDE + 1 : min(k + _NEAR + 1, power.size)]
    if near.size < _NEAR // 2 or power[k] < _LINE * np.median(power[near]):
        return None
    below, at, above = np.log(power[k - 1 : k + 2]) if k + 1 < power.size else (0.0, 1.0, 0.0)
    if below > at:
        return None
    # Interpolate by a parabola through the log power.
    aside = 0.5 * (below - above) / (below - 2 * at + above)
    return (k + aside) * step


def _tuned(t: np.ndarray, unit: np.ndarray, lines: Sequence[float], left: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Refine line frequencies by least squares; return them and the residual.

    With ``a cos + b sin`` the derivative with respect to the angular frequency is ``t (b cos - a sin)``.
    """
    since, tuned = t - t.mean(), np.array(lines)
    resolution = 1 / np.ptp(t)
    for _ in range(_TUNINGS):
        waves = [f(2 * np.pi * line * since) * unit for line in tuned for f in (np.cos, np.sin)]
        columns = np.column_stack([*waves, *(since * wave for wave in waves)])
        (a, b), (c, d) = np.linalg.lstsq(columns, left, rcond=None)[0].reshape(2, -1, 2).transpose(0, 2, 1)
        off = (b * c - a * d) / (2 * np.pi * np.maximum(a**2 + b**2, np.finfo(float).tiny))
        tuned = tuned + np.clip(off, -resolution / 2, resolution / 2)
    waves = waves_of(t, unit, tuned)
    return tuned.tolist(), left - waves @ np.linalg.lstsq(waves, left, rcond=None)[0]
