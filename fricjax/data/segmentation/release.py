"""Where a free decay begins and ends: after the hold or the hand that guides the mass, and where it comes to rest."""

import dataclasses

import numpy as np

from .noise import line_fit
from .reversals import order_for, refine, window
from .swing import Swing

# Friction takes energy away, so that a free mass approaches a reversal faster than it leaves it; a hand does not.
SLOW_APPROACH = 1.1
# Part of a half-cycle by which smoothing, over a sixteenth, and sampling may part two extremes that are one.
UNSEEN = 0.1
# A creep moves the mass at rest by more than noise of this many standard deviations, of any colour, spans about a line.
_CREEPS = 10.0


def locate_release(swing: Swing, pivots: list[int]) -> tuple[float, list[int]]:
    """Time of the release [s], and the extremes from the one where the free motion starts.

    The first extreme is the pole from which the record starts. If the mass was led to the second one by hand, it came
    there more slowly than it leaves: friction can only take energy away, so a free mass does the opposite.
    """
    t = swing.t
    guided = len(pivots) >= 3 and _is_guided(swing, pivots)
    if guided and _is_tiny(swing, pivots):
        # The noise of a hold, which then moves the mass so far all the time.
        swing = dataclasses.replace(swing, threshold=max(swing.threshold, swing.distance(*pivots[:2])))
    pivots = pivots[1:] if guided else pivots
    earliest = float(t[pivots[0]]) if guided else float(t[0])
    onset = _onset(swing, pivots)
    at_rest_before = onset > earliest + max(2.5 * swing.interval, 0.02 * swing.half_period)
    release = onset if at_rest_before else earliest
    return release, [int(np.clip(np.searchsorted(t, release), 0, pivots[1] - 1)), *pivots[1:]]


def _is_guided(swing: Swing, pivots: list[int]) -> bool:
    """Whether the mass came to the first reversal more slowly than it left, or stayed there."""
    first, reversal, after = pivots[:3]
    size = swing.distance(reversal, after)
    way = swing.distance(first, reversal)
    if _is_tiny(swing, pivots):
        # Noise moves the extremes by what it hides; but a free mass covers so short a way in a moment.
        moment = _time_to_leave(swing, way / size) + _time_to_leave(swing, swing.threshold / size)
        return bool(swing.t[reversal] - swing.t[first] > moment + UNSEEN * swing.half_period)
    depth = min(way, 0.5 * size)
    beyond = np.abs(swing.smoothed[first : after + 1] - swing.smoothed[reversal]) >= depth
    inward, outward = np.flatnonzero(beyond[: reversal - first]), np.flatnonzero(beyond[reversal - first :])
    if not inward.size or not outward.size:
        return False
    approach = swing.t[reversal] - swing.t[first + inward[-1]]
    departure = swing.t[reversal + outward[0]] - swing.t[reversal]
    slow = approach > SLOW_APPROACH * departure and approach > 0.1 * swing.half_period
    free = _time_to_leave(swing, depth / size)
    return bool(slow or approach + departure > 4.0 * free + 0.5 * swing.half_period)


def _is_tiny(swing: Swing, pivots: list[int]) -> bool:
    """Whether the way to the first reversal is too short for its speed to be seen."""
    first, reversal, after = pivots[:3]
    size = swing.distance(reversal, after)
    return min(swing.distance(first, reversal), 0.5 * size) < max(30.0 * swing.threshold, 0.02 * size)


def _time_to_leave(swing: Swing, share: float) -> float:
    """Time in which a free mass covers the first share of a half-cycle [s]."""
    return float(swing.half_period / np.pi * np.arccos(np.clip(1.0 - 2.0 * share, -1.0, 1.0)))


def _onset(swing: Swing, pivots: list[int]) -> float:
    """Instant at which the mass sets out from rest, from the shape of its first half-cycle."""
    pole, reversal = pivots[:2]
    size = swing.distance(pole, reversal)
    close = np.abs(swing.smoothed[pole:reversal] - swing.smoothed[pole]) <= swing.threshold
    left = pole + int(np.flatnonzero(close)[-1])
    guess = float(swing.t[left]) - _time_to_leave(swing, swing.distance(pole, left) / size)
    if guess <= swing.t[0]:
        return float(swing.t[0])
    width = window(swing.half_period, size / 2, swing.noise, swing.interval)
    width = np.maximum(2.0 * width, 0.15 * swing.half_period)
    onset, _ = refine(swing.t, swing.x, guess, np.pi / swing.half_period, [(width, 3)], before="still")
    return float(onset[0])


def locate_rest(swing: Swing, begin: float, end: float) -> tuple[float, float]:
    """Instant [s] and position of the stop: motion before, rest or a slow creep after it.

    Args:
        swing: the record.
        begin: instant of the last reversal [s].
        end: instant of the stop, as the clock has it [s].
    """
    t, x, half = swing.t, swing.x, swing.half_period
    first, last = (min(int(np.searchsorted(t, at)), t.size - 1) for at in (begin, end))
    size = swing.distance(first, last)
    # The clock may have the stop early.
    resting = slice(min(int(np.searchsorted(t, end + 0.1 * half, side="right")), t.size - 1), None)
    creeps = False
    if t[resting].size >= 8:
        _, residual = line_fit(t[resting], swing.smoothed[resting])
        creeps = bool(np.ptp(swing.smoothed[resting]) > max(swing.threshold, _CREEPS * float(np.std(residual))))
    width, order = window(half, size / 2, swing.noise, swing.interval), order_for(size, swing.noise)
    windows = [(np.maximum(width, 0.25 * half), order), (width, order)]
    instant, position = refine(t, x, end, np.pi / half, windows, after="creeping" if creeps else "still")
    return float(instant[0]), float(position[0] if creeps else x[resting].mean())
