from .axes import axis_label, figure, save, scaled
from .numbers import duration, engineering, interval, plain, uncertain
from .tables import Table
from .units import display_unit

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
