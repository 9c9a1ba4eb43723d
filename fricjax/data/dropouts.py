"""Dropouts: samples that repeat one value while the mass moves on, as a lost signal or the end of a converter leaves.

Values repeat in sound records too: at rest, and where a slow motion stays within a step of the converter. So a run of
equal values is a dropout only if the samples on either side say that the motion went elsewhere meanwhile.
"""

import itertools
from typing import NamedTuple

import numpy as np

from .segmentation.noise import resolution, white_noise

# Equal samples that make a run; two may be equal by chance.
_FEWEST = 3
# Samples on either side of a run by which a motion is carried across it, and the order of its polynomial.
_SIDE, _ORDER = 12, 5
# Steps from sample to sample before or after a run, and by how much a last step must exceed their changes.
_STEPS, _ABRUPT = 4, 4.0
# Longest run across which a polynomial is carried, in samples.
_LONGEST = 24
# How far the motion must have gone from the repeated value, in standard deviations of one sample.
_FAR = 8.0
# And in the steps from sample to sample that the motion takes, root mean square.
_MOVES = 0.25


class Dropout(NamedTuple):
    """A run of equal samples in a motion: the first of them, the one after the last, and their value."""

    start: int
    stop: int
    value: float


def dropouts(t: np.ndarray, x: np.ndarray) -> list[Dropout]:
    """The dropouts of a record.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
    """
    edges = np.flatnonzero(np.diff(x, prepend=np.nan, append=np.nan) != 0.0)
    runs = [(int(a), int(b)) for a, b in itertools.pairwise(edges) if b - a >= _FEWEST]
    if not runs:
        return []
    step = resolution(x)
    noise = max(white_noise(t, x, step), 1e-11 * float(np.ptp(x)))
    # A motion that is rounded stays within half a step on either side, and encoders hold a value where it turns.
    far = max(_FAR * noise, 2.0 * step, _MOVES * float(np.sqrt(np.mean(np.diff(x) ** 2))))
    return [Dropout(a, b, float(x[a])) for a, b in runs if _breaks(x, a, b, far) or _departs(t, x, a, b, far)]


def _breaks(x: np.ndarray, start: int, stop: int, far: float) -> bool:
    """Whether the motion breaks off at one end of the run, or goes on from the other, as no mass can."""

    def broken(last: float, before: np.ndarray) -> bool:
        # A step to the value larger than any change of the steps until then.
        return before.size == _STEPS and abs(last) > max(far, _ABRUPT * float(np.abs(np.diff(before)).max()))

    steps = np.diff(x)
    come, left = steps[max(start - 1 - _STEPS, 0) : start - 1], steps[stop : stop + _STEPS][::-1]
    return (start > 0 and broken(steps[start - 1], come)) or (stop < x.size and broken(steps[stop - 1], left))


def _departs(t: np.ndarray, x: np.ndarray, start: int, stop: int, far: float) -> bool:
    """Whether a polynomial through the samples on either side leaves the value in between."""
    if stop - start > _LONGEST or start < _SIDE or stop + _SIDE > x.size:
        return False
    places = np.r_[start - _SIDE : start, stop : stop + _SIDE]
    u = lambda i: 2 * (t[i] - t[places[0]]) / (t[places[-1]] - t[places[0]]) - 1
    fitted = np.polynomial.Legendre.fit(u(places), x[places] - x[start], _ORDER, domain=[-1, 1])
    left = x[places] - x[start] - fitted(u(places))
    within = np.abs(fitted(u(np.arange(start, stop))))
    # Most of the run lies elsewhere, by more than the polynomial itself is wrong.
    return float(np.median(within)) > max(far, 4 * float(np.abs(left).max()))
