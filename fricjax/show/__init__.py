"""How numbers, tables and axes look: one style for summaries, notebooks, reports and the command line."""

from fricjax.show.axes import axis_label, figure, save, scaled
from fricjax.show.numbers import duration, engineering, interval, plain, uncertain
from fricjax.show.tables import Table
from fricjax.show.units import display_unit

__all__ = [
    "Table",
    "axis_label",
    "display_unit",
    "duration",
    "engineering",
    "figure",
    "interval",
    "plain",
    "save",
    "scaled",
    "uncertain",
]
