"""The noise of a record without its motion: coloured noise, hum, rounding.

In the middle of a half-cycle the motion is a polynomial to far below the noise. A mass at rest moves only with its
floor and the drift of its instrument. The residual of a polynomial in the motion and of a straight line in the rest is
the full noise of the record. Differences of neighbouring samples show only its white part.
"""

import numpy as np

from ...numbers import fast_length
from .half_cycles import HalfCycles
from .noise import line_fit, median
from .swing import PreparedTrace

# Part of a half-cycle to fit, and the order of a polynomial that leaves a residual of 1e-11 of a half-cosine there.
CENTRE, ORDER = (0.2, 0.8), 10
# Number of half-cycles to evaluate, and of samples in each; more would not improve the median.
HALF_CYCLES, SAMPLES = 16, 512
# Length of the stretches of rest for the line fits, in half-periods. A full cycle keeps vibration at the natural
# frequency and removes creep and drift. The first half-period after the stop may still ring and is left out.
STRETCH, RINGS = 2.0, 1.0
# Smallest ratio in power between a spectral line and its neighbours, and largest number of lines to report.
LINE, LINES = 30.0, 3
WIDE, NEAR = 3, 24  # half-width of a line and of the neighbourhood it is compared with [bins]
LONGEST = 1 << 17  # samples of a spectrum


def disturbance(trace: PreparedTrace, half_cycles: HalfCycles) -> tuple[float, float, tuple[tuple[float, float], ...]]:
    """Measure the noise of a record with known half-cycles.

    Returns:
        Standard deviation of the noise, slope of x over the rest [1/s] (0.0 if the rest is shorter than a cycle), and
        frequency [Hz] and amplitude of each hum line in the spectrum of the rest.
    """
    stop = float(half_cycles.edges[-1])
    parts = [_moving(trace, half_cycles.edges), _resting(trace, stop) if half_cycles.stopped else None]
    variances = np.array([variance for variance in parts if variance is not None])
    # Slow noise hides in the motion and jitter in the rest, so the larger variance dominates; similar ones average.
    total = max(float(np.mean(variances**4) ** (1 / 8)), trace.noise) if variances.size else trace.noise
    if not half_cycles.stopped:
        return total, 0.0, ()
    begin = int(np.searchsorted(trace.t, stop + RINGS * trace.half_period))
    t, x = trace.t[begin:], trace.x[begin:]
    long = t.size >= 8 and t[-1] - t[0] >= STRETCH * trace.half_period
    return total, line_fit(t, x)[0] if long else 0.0, _lines(trace, stop)


def _moving(trace: PreparedTrace, edges: np.ndarray) -> float | None:
    """Return the median residual variance of polynomials in the half-cycles.

    Returns None if there are too few samples.
    """
    if edges.size < 3:
        return None
    # The first half-cycle may hold a release.
    chosen = np.unique(np.linspace(1, edges.size - 2, HALF_CYCLES).astype(int))
    durations = np.diff(edges)[chosen]
    first, last = (np.searchsorted(trace.t, edges[chosen] + part * durations) for part in CENTRE)
    every = np.maximum(-(-(last - first) // SAMPLES), 1)
    enough = (last - first) // every >= 3 * ORDER
    if not enough.any():
        return None
    first, last, every = first[enough], last[enough], every[enough]
    number = int(np.min((last - first) // every))
    places = first[:, None] + every[:, None] * np.arange(number)
    t, x = trace.t[places], trace.x[places]
    u = 2 * (t - t[:, :1]) / (t[:, -1:] - t[:, :1]) - 1
    basis = np.linalg.qr(np.polynomial.chebyshev.chebvander(u, ORDER))[0]
    residual = (x - x.mean(axis=1, keepdims=True))[:, :, None]
    residual = residual - basis @ (basis.mT @ residual)
    return float(np.median(np.sum(residual**2, axis=(1, 2)))) / (number - ORDER - 1)


def _resting(trace: PreparedTrace, stop: float) -> float | None:
    """Return the median residual variance of straight lines through the rest.

    Returns None if the rest is too short.
    """
    t, x = trace.t, trace.x
    begin, length = stop + RINGS * trace.half_period, STRETCH * trace.half_period
    number = int((t[-1] - begin) / length)
    variances = []
    for i in np.unique(np.linspace(0, number - 1, HALF_CYCLES).astype(int)) if number >= 1 else []:
        first, last = np.searchsorted(t, begin + length * np.array([i, i + 1]))
        every = -(-int(last - first) // (8 * SAMPLES)) or 1
        stretch = slice(first, last, every)
        if t[stretch].size < 8:
            continue
        _, residual = line_fit(t[stretch], x[stretch])
        variances.append(float(residual @ residual) / (residual.size - 2))
    return float(np.median(variances)) if variances else None


def rest_spectrum(t: np.ndarray, x: np.ndarray, stop: float, half_period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the amplitude spectrum of the rest, without its drift.

    It is empty if the rest is shorter than two cycles.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
        stop: time of the stop [s].
        half_period: duration of a half-cycle [s].

    Returns:
        Frequencies [Hz] and amplitudes of a sine at each (Hann window), shape `(k,)` each.

    Examples:
        A hum of 3 nm at 50 Hz in a record that is at rest from 1 s on:

        >>> import numpy as np
        >>> from fricjax.data import rest_spectrum
        >>> t = np.arange(4000) / 1000
        >>> frequency, amplitude = rest_spectrum(t, 3e-9 * np.sin(2 * np.pi * 50 * t), stop=1.0, half_period=0.04)
        >>> print(f"{frequency[np.argmax(amplitude)]:.0f} Hz, {1e9 * amplitude.max():.0f} nm")
        50 Hz, 3 nm
    """
    longest = min(t.size - int(np.searchsorted(t, stop + RINGS * half_period)), LONGEST)
    if longest < 64 or t[-1] - t[-longest] < 2 * STRETCH * half_period:
        return np.empty(0), np.empty(0)
    # A length with a large prime factor would take thirty times longer.
    size = fast_length(longest, at_most=True)
    t, x = t[-size:], x[-size:]
    even = np.linspace(t[0], t[-1], t.size)
    y = np.interp(even, t, x - x.mean())
    u, weight = even - even.mean(), np.hanning(t.size)
    y = (y - y.mean() - (u @ y) / (u @ u) * u) * weight
    return np.fft.rfftfreq(t.size, even[1] - even[0]), 2 * np.abs(np.fft.rfft(y)) / weight.sum()


def _lines(trace: PreparedTrace, stop: float) -> tuple[tuple[float, float], ...]:
    """Return the lines in the spectrum of the rest, strongest first."""
    frequency, size = rest_spectrum(trace.t, trace.x, stop, trace.half_period)
    power, lines = size**2, []
    for k in np.argsort(power)[::-1][: 8 * LINES].tolist():
        # The window spreads a line over some bins; compare it with the bins beyond them.
        near = np.concatenate([power[max(k - NEAR, 1) : max(k - WIDE, 1)], power[k + WIDE + 1 : k + NEAR + 1]])
        alone = k >= WIDE and all(abs(k - other) > WIDE for other in lines)
        if alone and near.size >= NEAR // 2 and power[k] > LINE * median(near):
            lines.append(k)
    return tuple((float(frequency[k]), float(size[k])) for k in lines[:LINES])
