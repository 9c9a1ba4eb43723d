"""Pictures of a record."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import DataError
from ..show import axis_label, display_unit, figure
from .disturbance import rest_spectrum
from .segmentation import Segmentation

if TYPE_CHECKING:
    from .record import Record

_MANY_REVERSALS = 60


def displacement(quantity: str) -> str:
    """What the ordinate shows: a displacement in "m", an angle in "rad"."""
    return "Displacement" if quantity == "m" else "Angle"


def anatomy(record: "Record") -> Any:
    """The trace of a record with hold, release, reversals and rest marked, and the spectrum of its rest.

    Of a record that has no such parts only the trace is drawn, and the title says why.
    """
    try:
        found, why = record.segmentation, ""
    except DataError as error:
        found, why = None, str(error)
    t, used = record.t, record.mask
    factor, unit = display_unit(float(np.max(np.abs(record.x), where=used, initial=0.0)), record.quantity)
    frequency, size = _of_rest(record, found)
    drawing, axes = figure(2, 1, heights=(3, 2)) if frequency.size else figure(1, 1)
    top = axes[0, 0]
    top.plot(t, np.where(used, factor * record.x, np.nan), label="record", zorder=2)
    if found is not None:
        _mark(top, t, found, factor)
    top.set_xlabel(axis_label("Time", "s"))
    top.set_ylabel(axis_label(displacement(record.quantity), unit))
    top.set_title(": ".join(filter(None, [record.name, why])), fontsize=9, wrap=True)
    top.legend(loc="upper right", fontsize=8, framealpha=0.9)
    if frequency.size and found is not None:
        _spectrum(axes[1, 0], frequency[1:], size[1:], found.lines, record.quantity)
    return drawing


def _of_rest(record: "Record", found: Segmentation | None) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and amplitudes at rest; empty where the record does not come to rest."""
    if found is None:
        return np.empty(0), np.empty(0)
    stop = np.inf if found.rest is None else found.rest
    return rest_spectrum(record.t[record.mask], record.x[record.mask], stop, found.half_period)


def _mark(axes: Any, t: np.ndarray, found: Segmentation, factor: float) -> None:
    many = found.turning_times.size > _MANY_REVERSALS
    axes.plot(
        found.turning_times,
        factor * found.turning_points,
        linestyle="none",
        marker="o",
        markersize=1.5 if many else 3.5,
        label=f"{found.turning_times.size} reversals",
        zorder=3,
    )
    if found.release > t[0]:
        axes.axvspan(t[0], found.release, color="#E3F1EC", label="hold", zorder=0)
    axes.axvline(found.release, color="#009E73", linestyle=":", label=f"release {found.release:.4g} s")
    if found.rest is not None:
        axes.axvspan(found.rest, t[-1], color="0.92", label=f"rest from {found.rest:.4g} s", zorder=0)


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
