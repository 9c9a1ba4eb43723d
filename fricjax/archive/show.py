"""Units of archive columns, and a figure of a parameter over runs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..fitting.derived import UNITS
from ..fitting.names import NUISANCES
from ..show import axis_label, figure, rotary_unit

if TYPE_CHECKING:
    from pandas import DataFrame


def parameter_figure(table: "DataFrame", name: str, against: str) -> Any:
    """Plot a parameter of the ok rows with its combined standard errors."""
    for column in (name, against):
        if column != "run" and table[column].dtype.kind not in "fiu":
            raise UsageError(f"The column {column!r} holds no numbers, and cannot be drawn.")
    drawn, grid = figure()
    axes = grid[0, 0]
    columns = {column: np.asarray(table[column]) for column in table}
    laws = sorted(set(columns["friction"]))
    where = np.arange(len(table)) if against == "run" else columns[against].astype(float)
    errors = np.nan_to_num(columns.get(f"{name}_combined_std", np.zeros(len(table))), posinf=0.0)
    for law in laws:
        rows = (columns["status"] == "ok") & (columns["friction"] == law)
        axes.errorbar(where[rows], columns[name][rows], errors[rows], fmt=".", capsize=2, label=law)
    quantity = next((each for each in columns["quantity"] if isinstance(each, str) and each), "m")
    across, along = (unit_of(column, laws, quantity) for column in (against, name))
    axes.set_xlabel(axis_label(against.replace("_", " ").capitalize(), across))
    axes.set_ylabel(axis_label(name.replace("_", " "), along))
    if len(laws) > 1:
        axes.legend()
    return drawn


# Units of columns that are no parameters; "x" represents the unit of the displacement.
_PLAIN_UNITS = {
    **dict.fromkeys(("residual_rms", "sigma", "amplitude"), "x"),
    **dict.fromkeys(("duration", "seconds_read", "seconds_fit"), "s"),
    "rate": "Hz",
    "load": "N",
}


def unit_of(name: str, laws: Sequence[str], quantity: str = "m") -> str:
    """Return the SI unit of a column of a table.

    `laws` are the laws of the table; `quantity` is the unit of the displacement: "m", or "rad" for a rotary rig.
    """
    from .. import friction
    from ..friction.catalogue import CATALOGUE
    from ..oscillator import Oscillator, restoring

    summands = sorted({part for law in laws for part in law.split("+")} & CATALOGUE.keys())
    classes = [Oscillator, restoring.Cubic, restoring.Structural]
    classes += [getattr(friction, CATALOGUE[name].name) for name in summands]
    units = {key: each.unit for cls in classes for key, each in getattr(cls, "coefficients", {}).items()}
    unit = {**_PLAIN_UNITS, **units, **NUISANCES, **UNITS}.get(name.split("[")[0].rsplit(".", 1)[-1], "")
    return quantity if unit == "x" else rotary_unit(unit, quantity)
