"""Detection of dropouts: samples that repeat one value while the mass moves.

A lost signal or the end of the converter's range causes them. Values also repeat in sound records, at rest and where a
slow motion stays within one converter step. A run of equal values is therefore a dropout only if the samples on both
sides show that the motion left this value in between.
"""

import itertools
from typing import NamedTuple

import numpy as np

from .clock import repeated_samples
from .segmentation.noise import resolution, typical_interval, white_noise

# Fewest equal samples in a run; two may be equal by chance.
_FEWEST = 3
# Samples on either side of a run that are used to interpolate the motion across it, and the order of the polynomial.
_SIDE, _ORDER = 12, 5
# Number of steps before or after a run to compare with, and the factor by which an abrupt step exceeds their changes.
_STEPS, _ABRUPT = 4, 4.0
# Longest run that is bridged by a polynomial [samples].
_LONGEST = 24
# Smallest distance of the motion from the repeated value, in standard deviations of one sample.
_FAR = 8.0
# The same distance in units of the rms step between samples.
_MOVES = 0.25


class Dropout(NamedTuple):
    """A run of equal samples: first index, index after the last, value."""

    start: int
    stop: int
    value: float


def dropouts(t: np.ndarray, x: np.ndarray) -> list[Dropout]:
    """Find the dropouts among displacements and times [s], shape `(n,)`."""
    edges = np.flatnonzero(np.diff(x, prepend=np.nan, append=np.nan) != 0.0)
    runs = [(int(a), int(b)) for a, b in itertools.pairwise(edges) if b - a >= _FEWEST]
    if not runs:
        return []
    slow = repeated_samples(t, x)
    step = resolution(x)
    noise = max(white_noise(t, x, step), 1e-11 * float(np.ptp(x)))
    # Steps in a typical interval, so that a gap in the samples is no jump.
    steps = np.diff(x) / np.diff(t) * typical_interval(t)
    # A rounded motion stays within half a step on either side, and an encoder holds its value at a reversal.
    far = max(_FAR * noise, 2.0 * step, _MOVES * float(np.sqrt(np.mean(steps**2))))
    return [
        Dropout(a, b, float(x[a]))
        for a, b in runs
        if not slow[b - 1] and (_breaks(steps, a, b, far) or _departs(t, x, a, b, far))
    ]


def _breaks(steps: np.ndarray, start: int, stop: int, far: float) -> bool:
    """Return True if the motion jumps at one end of the run."""

    def broken(last: float, before: np.ndarray) -> bool:
        # The step to the repeated value is larger than any change of the steps before.
        return before.size == _STEPS and abs(last) > max(far, _ABRUPT * float(np.abs(np.diff(before)).max()))

    come, left = steps[max(start - 1 - _STEPS, 0) : start - 1], steps[stop : stop + _STEPS][::-1]
    return (start > 0 and broken(steps[start - 1], come)) or (stop <= steps.size and broken(steps[stop - 1], left))


def _departs(t: np.ndarray, x: np.ndarray, start: int, stop: int, far: float) -> bool:
    """Return True if the interpolated motion departs from the repeated value."""
    if stop - start > _LONGEST or start < _SIDE or stop + _SIDE > x.size:
        return False
    places = np.r_[start - _SIDE : start, stop : stop + _SIDE]
    u = lambda i: 2 * (t[i] - t[places[0]]) / (t[places[-1]] - t[places[0]]) - 1
    fitted = np.polynomial.Legendre.fit(u(places), x[places] - x[start], _ORDER, domain=[-1, 1])
    residual = x[places] - x[start] - fitted(u(places))
    within = np.abs(fitted(u(np.arange(start, stop))))
    # Most of the run must be off by more than the error of the polynomial.
    return float(np.median(within)) > max(far, 4 * float(np.abs(residual).max()))
