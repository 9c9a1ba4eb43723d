"""Release and rest: the beginning and the end of a free decay."""

import dataclasses

import numpy as np

from .noise import line_fit
from .reversals import order_for, refine, window
from .swing import PreparedTrace

# Friction takes energy away, so a free mass approaches a reversal faster than it leaves it. A hand may be slower.
SLOW_APPROACH = 1.1
# Part of a half-cycle by which smoothing (over a sixteenth) and sampling may split one extreme into two.
UNSEEN = 0.1
# A creep at rest is a drift larger than this multiple of the standard deviation about a line.
_CREEPS = 10.0


def locate_release(trace: PreparedTrace, pivots: list[int]) -> tuple[float, list[int]]:
    """Find the release [s] and the extremes from there on.

    The first extreme is the pole at the start of the record. If the mass approached the second extreme more slowly than
    it leaves it, a hand guided it there: friction can only take energy away, so a free mass does the opposite.
    """
    t = trace.t
    guided = len(pivots) >= 3 and _is_guided(trace, pivots)
    if guided and _is_tiny(trace, pivots):
        # The first move is noise of a hold. The mass then moves that far all the time.
        trace = dataclasses.replace(trace, threshold=max(trace.threshold, trace.distance(*pivots[:2])))
    pivots = pivots[1:] if guided else pivots
    earliest = float(t[pivots[0]]) if guided else float(t[0])
    onset = _onset(trace, pivots)
    at_rest_before = onset > earliest + max(2.5 * trace.interval, 0.02 * trace.half_period)
    release = onset if at_rest_before else earliest
    return release, [int(np.clip(np.searchsorted(t, release), 0, pivots[1] - 1)), *pivots[1:]]


def _is_guided(trace: PreparedTrace, pivots: list[int]) -> bool:
    """Return True if a hand guided the mass to the first reversal.

    The mass then reached it more slowly than it left, or stayed there.
    """
    first, reversal, after = pivots[:3]
    size = trace.distance(reversal, after)
    way = trace.distance(first, reversal)
    if _is_tiny(trace, pivots):
        # Noise shifts such extremes, but a free mass covers such a short distance in a moment.
        moment = _time_to_leave(trace, way / size) + _time_to_leave(trace, trace.threshold / size)
        return bool(trace.t[reversal] - trace.t[first] > moment + UNSEEN * trace.half_period)
    depth = min(way, 0.5 * size)
    beyond = np.abs(trace.smoothed[first : after + 1] - trace.smoothed[reversal]) >= depth
    inward, outward = np.flatnonzero(beyond[: reversal - first]), np.flatnonzero(beyond[reversal - first :])
    if not inward.size or not outward.size:
        return False
    approach = trace.t[reversal] - trace.t[first + inward[-1]]
    departure = trace.t[reversal + outward[0]] - trace.t[reversal]
    slow = approach > SLOW_APPROACH * departure and approach > 0.1 * trace.half_period
    free = _time_to_leave(trace, depth / size)
    return bool(slow or approach + departure > 4.0 * free + 0.5 * trace.half_period)


def _is_tiny(trace: PreparedTrace, pivots: list[int]) -> bool:
    """Return True if the first move is too short for a speed."""
    first, reversal, after = pivots[:3]
    size = trace.distance(reversal, after)
    return min(trace.distance(first, reversal), 0.5 * size) < max(30.0 * trace.threshold, 0.02 * size)


def _time_to_leave(trace: PreparedTrace, share: float) -> float:
    """Return the time a free mass takes for part of a half-cycle."""
    return float(trace.half_period / np.pi * np.arccos(np.clip(1.0 - 2.0 * share, -1.0, 1.0)))


def _onset(trace: PreparedTrace, pivots: list[int]) -> float:
    """Return the time at which the mass starts from rest [s].

    It follows from a fit of the first half-cycle.
    """
    pole, reversal = pivots[:2]
    size = trace.distance(pole, reversal)
    close = np.abs(trace.smoothed[pole:reversal] - trace.smoothed[pole]) <= trace.threshold
    left = pole + int(np.flatnonzero(close)[-1])
    guess = float(trace.t[left]) - _time_to_leave(trace, trace.distance(pole, left) / size)
    if guess <= trace.t[0]:
        return float(trace.t[0])
    width = window(trace.half_period, size / 2, trace.noise, trace.interval)
    width = np.maximum(2.0 * width, 0.15 * trace.half_period)
    onset, _ = refine(trace.t, trace.x, guess, np.pi / trace.half_period, [(width, 3)], before="still")
    return float(onset[0])


def locate_rest(trace: PreparedTrace, begin: float, end: float) -> tuple[float, float]:
    """Find the time [s] and the position of the stop.

    Before the stop the mass moves; afterwards it rests or creeps.

    Args:
        trace: the prepared trace.
        begin: time of the last reversal [s].
        end: predicted time of the stop [s].
    """
    t, x, half = trace.t, trace.x, trace.half_period
    first, last = (min(int(np.searchsorted(t, at)), t.size - 1) for at in (begin, end))
    size = trace.distance(first, last)
    # The prediction may be early.
    resting = slice(min(int(np.searchsorted(t, end + 0.1 * half, side="right")), t.size - 1), None)
    creeps = False
    if t[resting].size >= 8:
        _, residual = line_fit(t[resting], trace.smoothed[resting])
        creeps = bool(np.ptp(trace.smoothed[resting]) > max(trace.threshold, _CREEPS * float(np.std(residual))))
    width, order = window(half, size / 2, trace.noise, trace.interval), order_for(size, trace.noise)
    windows = [(np.maximum(width, 0.25 * half), order), (width, order)]
    instant, position = refine(t, x, end, np.pi / half, windows, after="creeping" if creeps else "still")
    return float(instant[0]), float(position[0] if creeps else x[resting].mean())
