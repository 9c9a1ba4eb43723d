"""How a force map looks: the table in text and HTML, the picture, and the plain data."""

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import Table, axis_label, display_unit, engineering, figure, uncertain

if TYPE_CHECKING:
    from .force_map import ForceMap

SIDES = {(1, 1): "+ accelerating", (1, -1): "+ decelerating", (-1, 1): "- accelerating", (-1, -1): "- decelerating"}
_MARKERS = ("o", "s", "^", "v")


def _units(found: "ForceMap") -> tuple[str, str]:
    """Units of speed and force."""
    return ("m/s", "N") if found.quantity == "m" else ("rad/s", "N m")


def table(found: "ForceMap") -> Table:
    """One row per entry of the map."""
    speed, force = _units(found)
    rows = [
        [SIDES[side], engineering(abs(v), speed), uncertain(abs(f), std, force), int(n)]
        for side, v, f, std, n in zip(_sides(found), found.velocity, found.force, found.std, found.count, strict=True)
    ]
    return Table(["Branch", "Speed", "Friction force", "Samples"], rows)


def _sides(found: "ForceMap") -> list[tuple[int, int]]:
    return list(zip(found.direction.tolist(), found.branch.tolist(), strict=True))


def facts(found: "ForceMap") -> list[tuple[str, str]]:
    """What is said of the whole map."""
    _, force = _units(found)
    fastest = engineering(float(np.max(np.abs(found.velocity))), _units(found)[0])
    return [
        ("mean friction force", uncertain(found.mean.value, found.mean.std, force)),
        ("coefficient of friction", f"{uncertain(found.mu.value, found.mu.std)} (the rig taken as exact)"),
        ("subtracted", f"damping {found.damping:.6g}, drag {found.drag:.6g} (SI)"),
        ("data", f"{len(found.offsets)} records, {int(found.count.sum())} samples, up to {fastest}"),
        *(("note", note) for note in found.notes),
    ]


def summary(found: "ForceMap") -> str:
    """The report as plain text."""
    lines = "\n".join(f"{name:<25}{value}" for name, value in facts(found))
    return f"{lines}\n\n{table(found).text()}"


def html(found: "ForceMap") -> str:
    """The report for a notebook."""
    lines = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in facts(found))
    return f"<table>{lines}</table>{table(found).html()}"


def plot(found: "ForceMap") -> Any:
    """Friction force against speed, directions and branches apart, with two standard deviations."""
    drawing, axes = figure(1, 1, heights=(1.5,))
    top = axes[0, 0]
    speed, force = _units(found)
    factor_v, unit_v = display_unit(float(np.max(np.abs(found.velocity))), speed)
    factor_f, unit_f = display_unit(abs(found.mean.value), force)
    sides = np.array(_sides(found))
    for side, marker in zip(SIDES, _MARKERS, strict=True):
        own = np.all(sides == side, axis=1)
        value, std = factor_f * (found.force * found.direction)[own], 2 * factor_f * found.std[own]
        look = {"linestyle": "none", "marker": marker, "markersize": 3, "label": SIDES[side]}
        top.errorbar(factor_v * np.abs(found.velocity[own]), value, std, **look)
    top.set_xscale("log")
    top.set_xlabel(axis_label("Speed", unit_v))
    top.set_ylabel(axis_label("Friction force", unit_f))
    top.legend(loc="best", fontsize=8)
    return drawing


def to_dict(found: "ForceMap") -> dict[str, Any]:
    """The map as plain data, in SI units."""
    arrays = ("velocity", "force", "std", "count", "direction", "branch", "edges")
    return {
        **{name: getattr(found, name).tolist() for name in arrays},
        "mean": {"value": found.mean.value, "std": found.mean.std},
        "mu": {"value": found.mu.value, "std": found.mu.std},
        "normal_force": found.normal_force,
        "damping": found.damping,
        "drag": found.drag,
        "offsets": [{"value": offset.value, "std": offset.std} for offset in found.offsets],
        "quantity": found.quantity,
        "notes": list(found.notes),
    }
