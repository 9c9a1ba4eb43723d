"""Figures of a record."""

from typing import Any

import numpy as np

from ..show import axis_label, display_unit, figure
from .observation import Observation
from .segmentation.decay import Segmentation
from .segmentation.disturbance import rest_spectrum

_MANY_REVERSALS = 60


def record_figure(trace: Any, observation: Observation, segmentation: Segmentation | None, title: str) -> Any:
    """Plot a trace with its segmentation and the spectrum of its rest.

    The reversals are marked at the times of the reading. Without a segmentation only the trace is drawn.
    """
    quantity = observation.unit
    t, x, used = (np.asarray(values) for values in (trace.t, trace.x, trace.mask))
    factor, unit = display_unit(float(np.max(np.abs(x), where=used, initial=0.0)), quantity)
    frequency = size = np.empty(0)
    if segmentation is not None and segmentation.rest is not None:
        frequency, size = rest_spectrum(t[used], x[used], segmentation.rest, segmentation.half_period)
    drawing, axes = figure(2, 1, heights=(3, 2)) if frequency.size else figure(1, 1)
    top = axes[0, 0]
    top.plot(t, np.where(used, factor * x, np.nan), label="record", zorder=2)
    if segmentation is not None:
        direct = observation.kind == "displacement"
        points = segmentation.turning_points if direct else np.interp(segmentation.turning_times, t[used], x[used])
        _mark(top, t, factor * points, segmentation)
    top.set_xlabel(axis_label("Time", "s"))
    top.set_ylabel(axis_label(observation.name, unit))
    top.set_title(title, fontsize=9, wrap=True)
    top.legend(loc="upper right", fontsize=8, framealpha=0.9)
    if segmentation is not None and frequency.size:
        lines = [(at, segmentation.gain * height) for at, height in segmentation.lines]
        _spectrum(axes[1, 0], frequency[1:], size[1:], lines, quantity)
    return drawing


def _mark(axes: Any, t: np.ndarray, points: np.ndarray, segmentation: Segmentation) -> None:
    many = segmentation.turning_times.size > _MANY_REVERSALS
    axes.plot(
        segmentation.turning_times,
        points,
        linestyle="none",
        marker="o",
        markersize=1.5 if many else 3.5,
        label=f"{segmentation.turning_times.size} reversals",
        zorder=3,
    )
    if segmentation.release > t[0]:
        axes.axvspan(t[0], segmentation.release, color="#E3F1EC", label="hold", zorder=0)
    axes.axvline(segmentation.release, color="#009E73", linestyle=":", label=f"release {segmentation.release:.4g} s")
    if segmentation.rest is not None:
        axes.axvspan(segmentation.rest, t[-1], color="0.92", label=f"rest from {segmentation.rest:.4g} s", zorder=0)


def _spectrum(axes: Any, frequency: np.ndarray, size: np.ndarray, lines: Any, quantity: str) -> None:
    """Plot the spectrum at rest.

    It shows instrument noise and floor vibration. Rounded data that stay constant at rest give no spectrum.
    """
    factor, unit = display_unit(float(np.max(size)), quantity)
    axes.loglog(frequency, np.maximum(factor * size, 1e-6 * factor * np.max(size) or 1e-300), linewidth=0.8)
    for at, height in lines:
        axes.plot(at, factor * height, "o", markersize=4, label=f"{at:.4g} Hz, {factor * height:.3g} {unit}")
    axes.set_xlabel(axis_label("Frequency", "Hz"))
    axes.set_ylabel(axis_label("Amplitude at rest", unit))
    if lines:
        axes.legend(loc="upper right", fontsize=8)
