"""What the noise of a run is, in the terms of its user.

Standard errors assume white residuals, and a wrong model, vibration or drift break that. The integrated autocorrelation
time tau says how many samples in a row carry the same information: standard errors of slowly varying parameters are too
small by about sqrt(tau), and by the square root of the reduced chi^2 beside it where the noise was given (Sokal, 1996).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.hum import fast_length
from ..show import engineering

_BLOCK = 1 << 17


class Line(NamedTuple):
    """A hum: its frequency [Hz], and the sizes of its cosine and sine in the unit of the record, in the run's time."""

    frequency: float
    cosine: float
    sine: float


class Noise(NamedTuple):
    """The noise of a run as its residuals show it.

    Attributes:
        excess: standard deviation of the samples, beside hum and drift, in units of that stated.
        memory: time in which it forgets by a factor of e [s], 0 for white noise, inf for a random walk.
        rounding: steps to which the reading is rounded where that shows, in the unit of the record, else 0.
        jitter: standard deviation of the instants of the samples [s], 0 where none shows.
        drift: speed at which the reading drifts, in the unit of the record per second, 0 where none shows.
        middle: instant of the run at which the drift counts as zero [s].
        lines: the lines of a hum.
        expected: standard deviation that the noise of the rest would have all over the run, in units of that stated;
            0 where the rest is too short to tell.
        floor: spectral density of an acceleration of the floor that shakes the mass, in squared units of the record
            over s^4 Hz, 0 where none shows.
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
        """Drift and hum at times of the run [s], in the unit of the record."""
        waves = sum(
            line.cosine * np.cos(2 * np.pi * line.frequency * t) + line.sine * np.sin(2 * np.pi * line.frequency * t)
            for line in self.lines
        )
        return self.drift * (t - self.middle) + waves

    @property
    def white(self) -> bool:
        """Whether it is white, of whatever size."""
        return not any(self.words(""))

    def words(self, unit: str) -> Iterator[str]:
        """What makes it other than white noise of the size stated."""
        if np.isinf(self.memory):
            yield "walks at random"
        elif self.memory:
            yield f"remembers for {engineering(self.memory, 's')}"
        if self.rounding:
            yield f"is rounded to steps of {engineering(self.rounding, unit)}"
        if self.drift:
            yield f"drifts by {engineering(abs(self.drift), f'{unit}/s')}"
        for line in self.lines:
            size = engineering(float(np.hypot(line.cosine, line.sine)), unit)
            yield f"hums at {engineering(line.frequency, 'Hz')} by {size}"
        if self.floor:
            yield f"is a motion of the mass, shaken by {self.floor:.2g} ({unit}/s^2)^2/Hz"
        if self.jitter:
            yield f"grows with velocity, from a clock that jitters by {engineering(self.jitter, 's')}"


class Whiteness(NamedTuple):
    """Verdict on the residuals.

    Attributes:
        lag_one: autocorrelation of neighbouring samples.
        correlation_time: integrated autocorrelation time in samples, one for white residuals.
        white: whether neighbouring samples are uncorrelated within `thresholds.SURE` standard errors.
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
    return Whiteness(float(correlation[1]), max(time, 1.0), bool(abs(correlation[1]) < thresholds.SURE / np.sqrt(n)))


def _autocorrelation(centred: np.ndarray) -> np.ndarray:
    """Sums of products of samples some lag apart, for lags up to half the record or half a block of a long one.

    A long record is cut into blocks, so that the cost stays linear; products across their borders are left out.
    """
    length = min(centred.size, _BLOCK)
    blocks = np.pad(centred, (0, -centred.size % length)).reshape(-1, length)
    # So long that the lags do not wrap around.
    size = fast_length(length + length // 2)
    spectrum = sum(np.abs(np.fft.rfft(block, size)) ** 2 for block in blocks)
    return np.fft.irfft(spectrum, size)[: length // 2]
