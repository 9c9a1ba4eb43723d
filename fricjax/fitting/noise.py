"""Description of a run's noise, and a whiteness test of residuals.

Standard errors assume white residuals; a wrong model, vibration or drift violate that. The integrated autocorrelation
time tau is the number of consecutive samples that carry the information of one. Standard errors of slowly varying
parameters are too small by about sqrt(tau), and also by the square root of the reduced chi^2 if the noise was given
(Sokal, 1996).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..numbers import fast_length
from ..show import engineering

_BLOCK = 1 << 17


class Line(NamedTuple):
    """A hum: frequency [Hz], cosine and sine amplitudes.

    Amplitudes are in the unit of the record; times are those of the run.
    """

    frequency: float
    cosine: float
    sine: float


class Noise(NamedTuple):
    """The noise of a run as its residuals show it.

    Attributes:
        excess: standard deviation of the samples without hum and drift, over the stated one.
        memory: correlation time [s] (decay by a factor e); 0 for white noise, inf for a random walk.
        rounding: step of rounding if it shows, in the unit of the record, else 0.
        jitter: standard deviation of the sampling times [s]; 0 if not significant.
        drift: drift rate of the reading, in the unit of the record per second; 0 if not significant.
        middle: time of the run at which the drift is zero [s].
        lines: the lines of a hum.
        expected: standard deviation of the noise at rest, extrapolated to the whole run, over the stated one; 0 if the
            rest is too short.
        floor: spectral density of floor acceleration, in squared units of the record over s^4 Hz; 0 if not significant.
    """

    excess: float = 1.0
    memory: float = 0.0
    rounding: float = 0.0
    jitter: float = 0.0
    drift: float = 0.0
    middle: float = 0.0
    lines: tuple[Line, ...] = ()
    expected: float = 0.0
    floor: float = 0.0

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return drift and hum at times of the run [s]."""
        waves = sum(
            line.cosine * np.cos(2 * np.pi * line.frequency * t) + line.sine * np.sin(2 * np.pi * line.frequency * t)
            for line in self.lines
        )
        return self.drift * (t - self.middle) + waves

    @property
    def white(self) -> bool:
        """True if it is white, of any level."""
        return not any(self.words(""))

    def words(self, unit: str) -> Iterator[str]:
        """Yield descriptions of deviations from white noise of the stated level."""
        if np.isinf(self.memory):
            yield "is a random walk"
        elif self.memory:
            yield f"has a correlation time of {engineering(self.memory, 's')}"
        if self.rounding:
            yield f"is rounded to steps of {engineering(self.rounding, unit)}"
        if self.drift:
            yield f"drifts by {engineering(abs(self.drift), f'{unit}/s')}"
        for line in self.lines:
            size = engineering(float(np.hypot(line.cosine, line.sine)), unit)
            yield f"has a hum at {engineering(line.frequency, 'Hz')} of {size}"
        if self.floor:
            yield f"is floor vibration of {self.floor:.2g} ({unit}/s^2)^2/Hz"
        if self.jitter:
            yield f"grows with velocity (timing jitter of {engineering(self.jitter, 's')})"


class Whiteness(NamedTuple):
    """Whiteness test of residuals.

    Attributes:
        lag_one: autocorrelation of adjacent samples.
        correlation_time: integrated autocorrelation time in samples; one for white residuals.
        white: True if adjacent samples are uncorrelated within `thresholds.SURE` standard errors.
    """

    lag_one: float
    correlation_time: float
    white: bool


def whiteness(residuals: np.ndarray) -> Whiteness:
    """Test residuals for whiteness, given in time order and standard deviations."""
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
    return Whiteness(float(correlation[1]), max(time, 1.0), bool(abs(correlation[1]) < thresholds.SURE / np.sqrt(n)))


def _autocorrelation(centred: np.ndarray) -> np.ndarray:
    """Return sums of products of samples at each lag.

    Lags extend to half the record, or half a block of a long one. A long record is cut into blocks, so that the cost
    stays linear; products across block boundaries are omitted.
    """
    length = min(centred.size, _BLOCK)
    blocks = np.pad(centred, (0, -centred.size % length)).reshape(-1, length)
    # Long enough that the lags do not wrap around.
    size = fast_length(length + length // 2)
    spectrum = sum(np.abs(np.fft.rfft(block, size)) ** 2 for block in blocks)
    return np.fft.irfft(spectrum, size)[: length // 2]
