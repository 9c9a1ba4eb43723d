"""What is left of a record without its swing: noise of every colour, hum, rounding.

In the middle of a half-cycle the motion is a polynomial to far below any noise, and a mass at rest moves no more than
its floor and its instrument drift. What a polynomial leaves of the one, and a straight line of the other, is the noise
of the record: all of it, where differences of neighbouring samples see only its white part.
"""

import numpy as np

from .half_cycles import HalfCycles
from .noise import line_fit, median
from .swing import Swing

# Part of a half-cycle that is fitted, and the order of a polynomial that leaves 1e-11 of a half-cosine there.
CENTRE, ORDER = (0.2, 0.8), 10
# Half-cycles and samples of each that are evaluated: more would add nothing to the median.
HALF_CYCLES, SAMPLES = 16, 512
# Stretches of rest in which a line is taken out, in half-periods: a full cycle, so that shaking at the natural
# frequency is seen and a creep or a drift is not. The first half-period after the stop may still ring.
STRETCH, RINGS = 2.0, 1.0
# A line of the spectrum stands out by this factor in power of its neighbours; so many are named.
LINE, LINES = 30.0, 3
WIDE, NEAR = 3, 24  # bins that a line fills to either side, and those about it that it is compared with
LONGEST = 1 << 17  # samples of a spectrum


def disturbance(swing: Swing, half_cycles: HalfCycles) -> tuple[float, float, tuple[tuple[float, float], ...]]:
    """The noise of a record whose half-cycles are known.

    Returns:
        Its standard deviation, the slope of x over the rest [1/s] (0.0 where that is shorter than a cycle), and
        frequency [Hz] and amplitude of each hum that stands out of the rest.
    """
    stop = float(half_cycles.edges[-1])
    parts = [_moving(swing, half_cycles.edges), _resting(swing, stop) if half_cycles.stopped else None]
    variances = np.array([variance for variance in parts if variance is not None])
    # The larger one counts, for slow noise hides in the motion and jitter in the rest; of two like ones their mean.
    total = max(float(np.mean(variances**4) ** (1 / 8)), swing.noise) if variances.size else swing.noise
    if not half_cycles.stopped:
        return total, 0.0, ()
    begin = int(np.searchsorted(swing.t, stop + RINGS * swing.half_period))
    t, x = swing.t[begin:], swing.x[begin:]
    long = t.size >= 8 and t[-1] - t[0] >= STRETCH * swing.half_period
    return total, line_fit(t, x)[0] if long else 0.0, _lines(swing, stop)


def _moving(swing: Swing, edges: np.ndarray) -> float | None:
    """Median over half-cycles of the variance about a polynomial in the middle of each; None for too few samples."""
    if edges.size < 3:
        return None
    # The first half-cycle may hold a release.
    chosen = np.unique(np.linspace(1, edges.size - 2, HALF_CYCLES).astype(int))
    durations = np.diff(edges)[chosen]
    first, last = (np.searchsorted(swing.t, edges[chosen] + part * durations) for part in CENTRE)
    every = np.maximum(-(-(last - first) // SAMPLES), 1)
    enough = (last - first) // every >= 3 * ORDER
    if not enough.any():
        return None
    first, last, every = first[enough], last[enough], every[enough]
    number = int(np.min((last - first) // every))
    places = first[:, None] + every[:, None] * np.arange(number)
    t, x = swing.t[places], swing.x[places]
    u = 2 * (t - t[:, :1]) / (t[:, -1:] - t[:, :1]) - 1
    # Evenly spaced, these polynomials are so nearly orthogonal that normal equations lose no digit that counts.
    basis = np.polynomial.chebyshev.chebvander(u, ORDER)
    residual = (x - x.mean(axis=1, keepdims=True))[:, :, None]
    residual = residual - basis @ np.linalg.solve(basis.mT @ basis, basis.mT @ residual)
    return float(np.median(np.sum(residual**2, axis=(1, 2)))) / (number - ORDER - 1)


def _resting(swing: Swing, stop: float) -> float | None:
    """Median variance about straight lines through stretches of the rest; None where it is too short."""
    t, x = swing.t, swing.x
    begin, length = stop + RINGS * swing.half_period, STRETCH * swing.half_period
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
    """Amplitude spectrum of the rest, without its drift; empty where the rest is shorter than two cycles.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
        stop: instant of the stop [s].
        half_period: duration of a half-cycle [s].

    Returns:
        Frequencies [Hz] and the amplitudes that a sine there would have (a Hann window's), shape `(k,)` each.

    Examples:
        A hum of 3 nm at 50 Hz, 1 s after the start of a record that is at rest from there on:

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
    # Imported where there is a rest, for it takes longer than a fit.
    from scipy.fft import prev_fast_len

    # A length with a large prime factor would take thirty times as long.
    size = int(prev_fast_len(longest, real=True) or longest)
    t, x = t[-size:], x[-size:]
    even = np.linspace(t[0], t[-1], t.size)
    y = np.interp(even, t, x - x.mean())
    u, weight = even - even.mean(), np.hanning(t.size)
    y = (y - y.mean() - (u @ y) / (u @ u) * u) * weight
    return np.fft.rfftfreq(t.size, even[1] - even[0]), 2 * np.abs(np.fft.rfft(y)) / weight.sum()


def _lines(swing: Swing, stop: float) -> tuple[tuple[float, float], ...]:
    """The lines that stand out of the spectrum of the rest, the strongest first."""
    frequency, size = rest_spectrum(swing.t, swing.x, stop, swing.half_period)
    power, lines = size**2, []
    for k in np.argsort(power)[::-1][: 8 * LINES].tolist():
        # A line fills some bins under the window; those beyond are what it stands out of.
        near = np.concatenate([power[max(k - NEAR, 1) : max(k - WIDE, 1)], power[k + WIDE + 1 : k + NEAR + 1]])
        alone = k >= WIDE and all(abs(k - other) > WIDE for other in lines)
        if alone and near.size >= NEAR // 2 and power[k] > LINE * median(near):
            lines.append(k)
    return tuple((float(frequency[k]), float(size[k])) for k in lines[:LINES])
