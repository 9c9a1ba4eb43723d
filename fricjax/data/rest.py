"""Where a free decay ends: the instant of the stop, and the position of the rest that may still creep or drift."""

import numpy as np

from .reversals import order_for, refine, window
from .swing import Swing

# A creep moves the mass at rest by more than noise of this many standard deviations, of any colour, spans about a line.
_CREEPS = 10.0


def find_rest(swing: Swing, begin: float, end: float) -> tuple[float, float]:
    """Instant [s] and position of the stop: motion before, stillness or a slow creep after it.

    Args:
        swing: the record.
        begin: instant of the last reversal [s].
        end: instant of the stop, as the clock has it [s].
    """
    t, x, half = swing.t, swing.x, swing.half_period
    first, last = (min(int(np.searchsorted(t, at)), t.size - 1) for at in (begin, end))
    size = swing.stroke(first, last)
    settled = min(int(np.searchsorted(t, end + 0.1 * half, side="right")), t.size - 1)
    creeps = _creeps(t[settled:], swing.smoothed[settled:], swing.threshold)
    width = window(half, size / 2, swing.noise, swing.interval)
    order = order_for(size, swing.noise)
    windows = [(np.maximum(width, 0.25 * half), order), (width, order)]
    instant, position = refine(t, x, end, np.pi / half, windows, after="creeping" if creeps else "still")
    return float(instant[0]), float(position[0] if creeps else x[settled:].mean())


def _creeps(t: np.ndarray, x: np.ndarray, threshold: float) -> bool:
    if t.size < 8:
        return False
    u, y = t - t.mean(), x - x.mean()
    left = y - (u @ y) / (u @ u) * u
    return bool(np.ptp(x) > max(threshold, _CREEPS * float(np.std(left))))
