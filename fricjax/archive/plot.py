"""A parameter of all runs of an archive in one picture."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..show import axis_label, figure
from .units import unit_of

if TYPE_CHECKING:
    from pandas import DataFrame


def parameter_figure(table: "DataFrame", name: str, against: str) -> Any:
    """The parameter of the rows that are ok with its combined standard errors, laws beside each other.

    Raises:
        UsageError: a column that holds no numbers.
    """
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
