"""Pictures of a record and of a simulated motion."""

from typing import Any

import numpy as np

from ..data import Record, rest_spectrum, segment_record
from ..oscillator import Motion
from ..show import axis_label, display_unit, figure

_MANY_REVERSALS = 60


def _axis(quantity: str) -> str:
    return "Displacement" if quantity == "m" else "Angle"


def anatomy(record: Record) -> Any:
    """The trace of a record with release, reversals and rest marked, and the spectrum of its rest."""
    found = segment_record(record)
    trace = record.trace
    x = np.where(np.asarray(trace.mask), np.asarray(trace.x), np.nan)
    factor, unit = display_unit(float(np.nanmax(np.abs(x))), record.quantity)
    t, used = np.asarray(trace.t), np.asarray(trace.mask)
    stop = np.inf if found.rest is None else found.rest
    frequency, size = rest_spectrum(t[used], np.asarray(trace.x)[used], stop, found.half_period)
    drawing, axes = figure(2, 1, heights=(3, 2)) if frequency.size else figure(1, 1)
    top = axes[0, 0]
    top.plot(np.asarray(trace.t), factor * x, label="record", zorder=2)
    many = found.turning_times.size > _MANY_REVERSALS
    top.plot(
        found.turning_times,
        factor * found.turning_points,
        linestyle="none",
        marker="o",
        markersize=1.5 if many else 3.5,
        label=f"{found.turning_times.size} reversals",
        zorder=3,
    )
    top.axvline(found.release, color="#009E73", linestyle=":", label=f"release {found.release:.4g} s")
    if found.rest is not None:
        top.axvspan(found.rest, float(trace.t[-1]), color="0.92", label=f"rest from {found.rest:.4g} s", zorder=0)
    top.set_xlabel(axis_label("Time", "s"))
    top.set_ylabel(axis_label(_axis(record.quantity), unit))
    top.set_title(str(record.meta.get("source", "")), fontsize=9)
    top.legend(loc="upper right", fontsize=8, framealpha=0.9)
    if frequency.size:
        _spectrum(axes[1, 0], frequency[1:], size[1:], found.lines, record.quantity)
    return drawing


def _spectrum(axes: Any, frequency: np.ndarray, size: np.ndarray, lines: Any, quantity: str) -> None:
    """What the instrument and the floor say while the mass rests; a rounded rest that never changes says nothing."""
    factor, unit = display_unit(float(np.max(size)), quantity)
    axes.loglog(frequency, np.maximum(factor * size, 1e-6 * factor * np.max(size) or 1e-300), linewidth=0.8)
    for at, height in lines:
        axes.plot(at, factor * height, "o", markersize=4, label=f"{at:.4g} Hz, {factor * height:.3g} {unit}")
    axes.set_xlabel(axis_label("Frequency", "Hz"))
    axes.set_ylabel(axis_label("Amplitude at rest", unit))
    if lines:
        axes.legend(loc="upper right", fontsize=8)


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
    top.set_ylabel(axis_label(_axis(record.quantity), unit))
    factor, unit = display_unit(float(np.max(np.abs(force))), "N" if record.quantity == "m" else "N m")
    bottom.plot(np.asarray(motion.t), factor * force, color="#D55E00")
    bottom.set_ylabel(axis_label("Friction force", unit))
    bottom.set_xlabel(axis_label("Time", "s"))
    return drawing
