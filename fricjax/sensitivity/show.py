"""How the information of a planned run looks: the report in text and HTML, and the plot of errors and correlations."""

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fitting.names import NUISANCES
from ..show import Table, axis_label, duration, engineering, figure

if TYPE_CHECKING:
    from .information import Information


def parameter_table(found: "Information") -> Table:
    """One row per parameter: expected value, standard error, and that over the value."""
    rows = []
    for name in found.names:
        value, std, unit = found.values[name], found.std_errors[name], found.units[name]
        note = "no effect" if name in found.idle else "" if np.isfinite(std) else "undetermined"
        rows.append([name, _with_unit(value, unit), _with_unit(std, unit, 2), _share(std, value), note])
    return Table(["Parameter", "Expected", "Standard error", "Relative", "Remarks"], rows)


def known_table(found: "Information") -> Table:
    """What needs no rig, and combinations that the run tells better than their parts."""
    told = {**{name.replace("_", " "): each for name, each in found.kinematics.items()}, **found.combinations}
    rows = [
        [name, _with_unit(each.value, each.unit), _with_unit(each.std, each.unit, 2), _share(each.std, each.value)]
        for name, each in told.items()
    ]
    return Table(["Told without a rig", "Expected", "Standard error", "Relative"], rows)


def correlation_table(found: "Information") -> Table:
    """Correlations of the coefficients that are determined."""
    lost = found.undetermined
    index = [i for i, name in enumerate(found.names) if name not in lost and name not in NUISANCES]
    names = [found.names[i] for i in index]
    rows = [[found.names[i], *(f"{found.correlation[i, j]:.3f}" for j in index)] for i in index]
    return Table(["Correlation", *names], rows)


def _with_unit(value: float, unit: str, digits: int = 6) -> str:
    return engineering(value, unit, digits) if np.isfinite(value) else ""


def _share(std: float, value: float) -> str:
    return f"{std / abs(value):.2g}" if value and np.isfinite(std) else ""


def facts(found: "Information") -> list[tuple[str, str]]:
    """The remaining lines of the report."""
    band, course = float(found.oscillator.dead_band), found.course
    about = "about " if course.like_coulomb else ""
    rest = "no stop"
    if course.half_cycles is not None:
        strokes = "1 half-cycle" if course.half_cycles == 1 else f"{course.half_cycles} half-cycles"
        rest = f"{about}{strokes}, stop {about}{duration(course.t_stop)} after the release"
    away = f", {abs(found.x0) / band:.3g} dead bands of {engineering(band, 'm')}" if band else ""
    noise = engineering(found.noise, "m")
    return [
        ("release", f"from {engineering(found.x0, 'm')}{away}"),
        ("motion", f"{rest}, {found.engine} engine"),
        ("record", f"{found.samples} samples at {found.rate:g} Hz, {duration(found.duration)}, white noise of {noise}"),
        ("rank", f"{found.rank} of {len(found.names)}, condition {found.condition:.2g}"),
        ("bound", "standard errors are those of white noise alone; they go with noise/sqrt(rate)"),
    ]


def summary(found: "Information") -> str:
    """The report as plain text."""
    lines = [f"{name + ':':<10}{text}" for name, text in facts(found)]
    lines += [f"!! {text}" for text in found.errors] + [f"! {text}" for text in found.remarks]
    tables = [parameter_table(found), known_table(found), correlation_table(found)]
    return "\n\n".join([*(table.text() for table in tables if table.rows), "\n".join(lines)])


def html(found: "Information") -> str:
    """The report as an HTML fragment."""
    sentences = [*(("error", text) for text in found.errors), *(("remark", text) for text in found.remarks)]
    tables = [parameter_table(found), known_table(found), correlation_table(found)]
    other = Table(["Planned run", ""], [*facts(found), *sentences])
    return "".join(table.html() for table in [*tables, other] if table.rows)


def to_dict(found: "Information") -> dict[str, Any]:
    """The report as plain data."""
    estimates = lambda told: {name: each._asdict() for name, each in told.items()}
    return {
        "names": list(found.names),
        "values": found.values,
        "units": found.units,
        "std_errors": found.std_errors,
        "covariance": found.covariance.tolist(),
        "correlation": found.correlation.tolist(),
        "rank": found.rank,
        "condition": found.condition,
        "undetermined": list(found.undetermined),
        "singular": [{"names": list(d.names), "changes": d.changes.tolist(), "text": d.text} for d in found.singular],
        "no_effect": list(found.idle),
        "errors": list(found.errors),
        "remarks": list(found.remarks),
        "kinematics": estimates(found.kinematics),
        "combinations": estimates(found.combinations),
        "n_half_cycles": found.course.half_cycles,
        "t_stop": found.course.t_stop,
        "dead_band": float(found.oscillator.dead_band),
        "x0": found.x0,
        **{name: getattr(found, name) for name in ("samples", "rate", "duration", "noise", "engine")},
    }


def plot(found: "Information") -> Any:
    """Relative standard errors as bars on the left, correlations as a map on the right; undetermined ones stay empty.

    Nuisances in metres are taken relative to the release.
    """
    drawing, axes = figure(1, 2)
    left, right = axes[0]
    names, rows = found.names, range(len(found.names))
    sizes = [abs(found.values[name]) or (abs(found.x0) if found.units[name] == "m" else 1.0) for name in names]
    shares = np.array([found.std_errors[name] / size for name, size in zip(names, sizes, strict=True)])
    left.barh(rows, np.where(np.isfinite(shares), shares, 0.0))
    if np.any(np.isfinite(shares)):
        left.set_xscale("log")
    left.set_xlabel(axis_label("Standard error over size", "1"))
    shown = right.imshow(found.correlation, vmin=-1, vmax=1, cmap="RdBu_r")
    right.set_xticks(rows, names, rotation=90)
    for axis in (left, right):
        axis.set_yticks(rows, names)
    left.invert_yaxis()
    right.grid(False)
    drawing.colorbar(shown, ax=right, label=axis_label("Correlation", "1"))
    drawing.suptitle(_title(found), fontsize=9)
    return drawing


def _title(found: "Information") -> str:
    run = f"Released from {engineering(found.x0, 'm')}, noise {engineering(found.noise, 'm')} at {found.rate:g} Hz"
    lost = f"undetermined: {', '.join(found.undetermined)}" if found.undetermined else "all determined"
    return "\n".join([run, *textwrap.wrap(lost, 100)])
