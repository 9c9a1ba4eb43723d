from .axes import Style, axis_label, figure, save, scaled, styled
from .numbers import duration, engineering, interval, parse_uncertain, plain, uncertain
from .report import Report, Reported, plain_data
from .tables import Cell, Table
from .units import display_unit, rotary_unit

__all__ = [
    "Cell",
    "Report",
    "Reported",
    "Style",
    "Table",
    "axis_label",
    "display_unit",
    "duration",
    "engineering",
    "figure",
    "interval",
    "parse_uncertain",
    "plain",
    "plain_data",
    "rotary_unit",
    "save",
    "scaled",
    "styled",
    "uncertain",
]
