"""Where a free decay ends: the stop, and the rest that may still creep or drift.

The last stroke may be very short, and a regularised or creeping contact goes on moving after it. What tells a stroke
from creep is its shape, not its size: it starts slowly, and after one half-period it is over.
"""

import numpy as np

from .reversals import refine, window
from .swing import Swing

CREEP = 0.03  # speed at rest, relative to the peak speed of the last stroke
SHORTEST_REST = 0.25  # in half-periods


def find_rest(swing: Swing, pivots: list[int]) -> tuple[float | None, float | None, list[int]]:
    """Time [s] and position of the stop, None while moving, and the extremes without those of the rest.

    The last of the returned extremes ends the last stroke: the stop, or the farthest point of the stroke still open.
    """
    last = len(pivots) - 2
    while last > 0 and not _is_stroke(swing, pivots, last):
        last -= 1
    kept = [*pivots[: last + 1], _end_of_stroke(swing, pivots[last], pivots[last + 1])]
    if last == len(pivots) - 2 and _still_moves(swing, *kept[-2:]):
        return None, None, pivots
    return *_stop(swing, *kept[-2:]), kept


def _is_stroke(swing: Swing, pivots: list[int], i: int) -> bool:
    """Whether the motion from extreme `i` to the next is a stroke of the oscillator, not creep, drift or ringing."""
    begin, end = pivots[i], pivots[i + 1]
    is_open = i == len(pivots) - 2
    lasts = (swing.t[-1] if is_open else swing.t[end]) - swing.t[begin]
    size = swing.stroke(begin, end)
    if is_open and lasts < 1.1 * swing.half_period:
        return _sets_out(swing, pivots, i)
    if size <= swing.threshold or lasts < 0.4 * swing.half_period:
        return False
    early, middle, late = (swing.moved(begin, end, share) for share in (0.15, 0.5, 1.3))
    after = (size - late) / max(lasts / swing.half_period - 1.3, 1e-3)
    over = late >= 0.7 * size or after < 0.1 * late / 1.3
    # A stroke of some size may start abruptly out of a dwell; a small one that does so is creep.
    previous = swing.stroke(pivots[i - 1], begin) if i > 0 else size
    abrupt = early > (0.3 if late > 0.1 * previous else 0.12) * late + 0.5 * swing.threshold
    return bool(over and not abrupt and middle >= 0.25 * late)


def _sets_out(swing: Swing, pivots: list[int], i: int) -> bool:
    """For a record that ends within a half-period of its last turn: whether the mass is on its way again."""
    begin, end = pivots[i], swing.x.size - 1
    lasts, moved = swing.t[-1] - swing.t[begin], swing.stroke(begin, end)
    if i == 0 or lasts < SHORTEST_REST * swing.half_period:
        return True
    peak_speed = np.pi / swing.half_period * swing.stroke(pivots[i - 1], begin) / 2
    return bool(moved > swing.threshold and moved / lasts > CREEP * peak_speed)


def _end_of_stroke(swing: Swing, begin: int, end: int) -> int:
    """Sample at which the stroke arrives: the extreme itself, or the knee before a plateau or a drift."""
    size = min(swing.stroke(begin, end), swing.moved(begin, end, 1.3) + 0.5 * swing.threshold)
    close = size - max(0.5 * swing.threshold, 1e-3 * size)
    way = swing.smoothed[begin : end + 1] - swing.smoothed[begin]
    arrived = begin + int(np.flatnonzero(way * np.sign(way[-1]) >= close)[0])
    remaining = np.arccos(1.0 - 2.0 * (1.0 - close / size)) / np.pi * swing.half_period
    return min(int(np.searchsorted(swing.t, swing.t[arrived] + remaining)), end)


def _still_moves(swing: Swing, begin: int, end: int) -> bool:
    """Whether the last stroke is unfinished, or too recently finished to tell a stop from a turn."""
    if swing.t[-1] - swing.t[end] < SHORTEST_REST * swing.half_period:
        return True
    tail = swing.smoothed[np.searchsorted(swing.t, swing.t[-1] - 0.15 * swing.half_period) :]
    return bool(np.ptp(tail) > max(swing.threshold, 0.1 * swing.stroke(begin, end)))


def _stop(swing: Swing, begin: int, end: int) -> tuple[float, float]:
    """Instant and position of the stop: motion before, stillness or a slow creep after it."""
    t, x, stroke = swing.t, swing.x, swing.stroke(begin, end)
    settled = int(np.searchsorted(t, t[end] + 0.1 * swing.half_period, side="right"))
    creeps = np.ptp(swing.smoothed[settled:]) > swing.threshold
    width = window(swing.half_period, stroke / 2, swing.noise, swing.interval)
    order = 4 if stroke > 1e3 * swing.noise else 2
    omega, after = np.pi / swing.half_period, "creeping" if creeps else "still"
    widths = [np.maximum(width, 0.25 * swing.half_period), width]
    instant, position = refine(t, x, t[end], omega, widths, order, after=after)
    return float(instant[0]), float(position[0] if creeps else x[settled:].mean())
