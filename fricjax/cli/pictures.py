"""Pictures of a simulated motion."""

from typing import Any

import numpy as np

from ..data import Record
from ..data.show import displacement
from ..oscillator import Motion
from ..show import axis_label, display_unit, figure


def motion_picture(motion: Motion, record: Record) -> Any:
    """Displacement and friction force of a simulated motion."""
    drawing, axes = figure(2, 1, share_x=True, heights=(3, 2))
    top, bottom = axes[:, 0]
    t, x, force = np.asarray(record.trace.t), np.asarray(record.trace.x), np.asarray(motion.friction_force)
    factor, unit = display_unit(float(np.max(np.abs(x))), record.quantity)
    top.plot(t, factor * x)
    stop = float(motion.t_stop)
    if stop <= t[-1]:
        top.axvspan(stop, t[-1], color="0.92", zorder=0, label=f"at rest from {stop:.6g} s")
        top.legend(loc="upper right", fontsize=8)
    top.set_ylabel(axis_label(displacement(record.quantity), unit))
    factor, unit = display_unit(float(np.max(np.abs(force))), "N" if record.quantity == "m" else "N m")
    bottom.plot(np.asarray(motion.t), factor * force, color="#D55E00")
    bottom.set_ylabel(axis_label("Friction force", unit))
    bottom.set_xlabel(axis_label("Time", "s"))
    return drawing
