"""Detection of clock faults: samples at wrong times.

A logger that is faster than its sensor writes each value several times. A logger that loses a sample, or writes one
twice, stamps all later samples a tick early or late. A clock that is set during a record jumps. In all these cases the
motion itself continues: with the right times, one smooth curve passes through the samples on both sides.

A step of the displacement by ``m v h``, with the velocity ``v``, the sampling interval ``h`` and an integer ``m``,
shows that the clock is wrong by m ticks. A slip of a fringe counter has a size that does not depend on the velocity.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .segmentation.noise import resolution, typical_interval, white_noise

# Samples on either side of a suspected fault, and order of the polynomial that continues the motion across it.
_SIDE, _ORDER = 8, 5
# Half of the span over which the motion per sample is measured [samples].
_REACH = 3
# Expected number of runs of equal samples in a record that are longer by chance than a slow sensor makes them.
_CHANCE = 0.01
# Motion per sample above which two samples do not agree by chance, in steps of the values and in standard deviations.
_STEPS, _NOISES = 4.0, 8.0
# Largest standard error of a clock error that is compared with whole ticks, in ticks, and largest deviation from one,
# in standard errors. A step of any size has a whole number of ticks by chance with a probability of at most 0.1. After
# a repeated sample only two numbers are possible, so five standard errors between them are enough.
_SHARP, _CLEAR, _FITTING = 0.02, 0.2, 3.0
# Error of the number of ticks for a record without noise: the remainder of the polynomial.
_ROUNDING = 1e-3
# Ratio of an interval to the typical one above which it is a gap.
_GAP = 1.5
# Largest number of places to test; a sensor that repeats its values everywhere has a right clock.
_MOST = 1000


class ClockFault(NamedTuple):
    """A fault of the clock.

    **Fields:**

    - `index`: the first sample after it; the number of samples if the record ends with repeated ones.
    - `shift`: time to add to this and all later samples [s]; 0.0 if only values repeat.
    - `repeats`: number of samples before `index` that repeat the value of an earlier one.
    """

    index: int
    shift: float
    repeats: int


def clock_faults(t: np.ndarray, x: np.ndarray, steps: Sequence[int] = ()) -> list[ClockFault]:
    """Find the faults of the clock of a record.

    Args:
        t: times [s], shape `(n,)`.
        x: displacements, shape `(n,)`.
        steps: indices of the first samples after steps that no smooth motion makes.

    Returns:
        The faults, in order.
    """
    if x.size < 2 * (2 * _SIDE + _ORDER):
        return []
    interval, repeated = typical_interval(t), repeated_samples(t, x)
    kept = np.flatnonzero(~repeated)
    t, x = t[kept], x[kept]
    before = np.diff(kept, prepend=kept[0] - 1) - 1
    jumps = np.flatnonzero(np.diff(t, prepend=t[0]) > _GAP * interval * (1 + before))
    places = np.union1d(np.flatnonzero(before), np.union1d(np.searchsorted(kept, np.asarray(steps, dtype=int)), jumps))
    shifts = np.zeros(kept.size)
    tested = places[(places >= _SIDE) & (places <= kept.size - _SIDE)]
    tested = tested[:: max(-(-tested.size // _MOST), 1)]
    shifts[tested] = _clock_errors(t, x, tested, before[tested], interval)
    faults = [
        ClockFault(int(kept[i]), float(shifts[i]), int(before[i])) for i in places.tolist() if before[i] or shifts[i]
    ]
    left = repeated.size - 1 - int(kept[-1])
    return [*faults, ClockFault(repeated.size, 0.0, left)] if left else faults


def repeated_samples(t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return True for samples that a slow sensor did not renew.

    They repeat the previous value although the mass moves. In a record that is not rounded, no two values agree by
    chance, not even at rest. Runs that are too long for the share of such samples are dropouts.
    """
    equal = np.diff(x, prepend=np.nan) == 0.0
    if not equal.any():
        return equal
    step, interval, new = resolution(x), typical_interval(t), ~equal
    noise = white_noise(t[new], x[new], step) if np.count_nonzero(new) > 4 * _SIDE else 0.0
    ends = np.clip(np.arange(x.size)[:, None] + np.array([-_REACH - 1, _REACH]), 0, x.size - 1).T
    moved = np.abs(x[ends[1]] - x[ends[0]]) / (t[ends[1]] - t[ends[0]]) * interval
    moves = moved > max(_STEPS * step, _NOISES * noise)
    repeated = equal & moves
    if not repeated.any():
        return repeated
    share = min(np.count_nonzero(repeated) / np.count_nonzero(moves), 0.9)
    runs = np.diff(np.flatnonzero(np.append(new, True)))
    usual = np.repeat(runs - 1 <= np.log(_CHANCE / x.size) / np.log(share), runs)
    return (equal if step == 0.0 else repeated) & usual


def _clock_errors(t: np.ndarray, x: np.ndarray, places: np.ndarray, before: np.ndarray, interval: float) -> np.ndarray:
    """Return the clock error at each place [s], zero if insignificant.

    At each place the samples on both sides are fitted by one polynomial and a step. Without the gap before the place,
    the step is the velocity times the clock error.
    """
    if not places.size:
        return np.zeros(0)
    near = places[:, None] + np.arange(-_SIDE, _SIDE)
    times, values = t[near], x[near] - x[near].mean(axis=1, keepdims=True)
    # One tick passes for each sample written. A gap may be shorter or longer than the time that really passed.
    gap = times[:, _SIDE] - times[:, _SIDE - 1] - interval
    times = times - times[:, _SIDE - 1 : _SIDE]
    times[:, _SIDE:] -= gap[:, None]
    u = times / np.maximum(-times[:, :1], times[:, -1:])
    after = np.arange(2 * _SIDE) >= _SIDE
    basis = np.concatenate(
        [u[:, :, None] ** np.arange(_ORDER + 1), np.broadcast_to(after, u.shape)[:, :, None]], axis=2
    )
    inverse = np.linalg.pinv(basis)
    coefficients = (inverse @ values[:, :, None])[:, :, 0]
    residual = values - (basis @ coefficients[:, :, None])[:, :, 0]
    deviation = np.sqrt(np.sum(residual**2, axis=1) / (2 * _SIDE - _ORDER - 2)) * np.linalg.norm(inverse[:, -1], axis=1)
    moved = coefficients[:, 1] / np.maximum(-times[:, 0], times[:, -1]) * interval
    safe = np.where(moved == 0, np.inf, moved)
    ticks, error = coefficients[:, -1] / safe, deviation / np.abs(safe)
    nearest = np.round(ticks)
    shift = nearest * interval - gap
    precise = error < np.where(before > 0, _CLEAR, _SHARP)
    sure = (moved != 0) & precise & (np.abs(ticks - nearest) < np.maximum(_FITTING * error, _ROUNDING))
    wrong = np.abs(shift) > 0.5 * interval
    # The motion across a long gap is unknown, but if none passes in it, the clock jumped.
    known = (gap < (before + 0.5) * interval) | (nearest == 0)
    return np.where(sure & wrong & known, shift, 0.0)
