"""Tables of results, as text, as HTML and as data frames.

A column is right-aligned if all its cells begin like a number, so that magnitudes can be compared by eye. Results that
hold arrays also become data sets of xarray, with names and units.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from ..errors import needed
from .numbers import plain

if TYPE_CHECKING:
    from pandas import DataFrame

_NUMERIC = re.compile(r"\s*([-+−±\[]?\.?\d|inf\b|nan\b|undetermined\b|-?$)")
# Cells up to this length stay on one line. A browser would break them at a sign or a blank.
_UNBROKEN = 28


class Cell(str):
    """The text of a table cell, with the numbers it shows.

    The text may round, scale and combine the numbers. A data frame has the numbers themselves. A float becomes text
    through `plain`, any other object through `str`.

    Attributes:
        numbers: numbers in SI units, or texts, by the column of the data frame.

    Examples:
        >>> from fricjax.show import Cell, uncertain
        >>> cell = Cell(uncertain(0.214523, 0.000312), value=0.214523, std=0.000312)
        >>> cell, cell.numbers
        ('0.21452(31)', {'value': 0.214523, 'std': 0.000312})
    """

    numbers: Mapping[str, Any]

    def __new__(cls, shown: object, **numbers: Any) -> Self:
        cell = super().__new__(cls, _text(shown))
        cell.numbers = numbers
        return cell


@dataclass(frozen=True)
class Table:
    """Rows under column heads.

    Attributes:
        columns: the heads, with units if the cells have no units, e.g. "Displacement [mm]".
        rows: one sequence of cells per row, each as long as `columns`. None is an empty cell. A float is shown through
            `plain`, any other object through `str`.
        title: a line above the table; empty: none.
        units: SI units of columns of the data frame, if they are the same in all rows.
        limit: number of rows to show; None: all. The data frame always has all rows.

    Examples:
        >>> from fricjax.rig import Measured
        >>> from fricjax.show import Cell, Table
        >>> rows = [["mu", Measured(0.214523, 0.000312), Cell("5 nm", noise=5e-9)]]
        >>> table = Table(["Coefficient", "Value", "Noise"], rows, units={"noise": "m"})
        >>> print(table)
        Coefficient        Value  Noise
        ───────────  ───────────  ─────
        mu           0.21452(31)   5 nm
        >>> frame = table.to_dataframe()
        >>> frame.columns.tolist(), frame["noise"].tolist(), frame.attrs["units"]
        (['coefficient', 'value', 'std', 'noise'], [5e-09], {'noise': 'm'})
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    title: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    limit: int | None = None

    def __post_init__(self) -> None:
        """Refuse a row that does not fit the heads."""
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(f"Row {index} has {len(row)} cells under {len(self.columns)} columns: {list(row)!r}.")

    def text(self) -> str:
        """Return aligned plain text without a newline at the end."""
        cells = [list(self.columns), *self.cells()]
        widths = [max(len(row[i]) for row in cells) for i in range(len(self.columns))]
        lines = [self._line(row, widths) for row in cells]
        rule = "  ".join("─" * width for width in widths)
        return "\n".join(([self.title] if self.title else []) + [lines[0], rule, *lines[1:]])

    def html(self) -> str:
        """Return the table as an HTML fragment; every cell is escaped."""
        styles = ["right" if numeric else "left" for numeric in self.numeric()]
        caption = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        head = _html_row("th", self.columns, styles)
        body = "".join(_html_row("td", row, styles) for row in self.cells())
        return f"<table>{caption}<thead>{head}</thead><tbody>{body}</tbody></table>"

    def to_dataframe(self) -> "DataFrame":
        """Return all numbers in SI units as a data frame.

        A `Cell` fills the columns that it names. Any other cell fills the column of its head, as "r_hat" for "R-hat",
        and a value with a standard uncertainty `NAME` and `NAME_std`, or `value` and `std`. The units of the table are
        in ``attrs["units"]``.
        """
        rows = [
            {name: value for pair in zip(self.columns, row, strict=True) for name, value in _numbers(*pair).items()}
            for row in self.rows
        ]
        return dataframe(rows, self.units)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return self.html()

    def cells(self) -> list[list[str]]:
        """Return the texts of the cells to show."""
        return [[_text(cell) for cell in row] for row in self.rows[: self.limit]]

    def numeric(self) -> list[bool]:
        """Return True for each column of numbers."""
        cells = self.cells()
        return [bool(cells) and all(_NUMERIC.match(row[i]) for row in cells) for i in range(len(self.columns))]

    def _line(self, row: Sequence[str], widths: Sequence[int]) -> str:
        aligned = zip(row, widths, self.numeric(), strict=True)
        return "  ".join(cell.rjust(width) if right else cell.ljust(width) for cell, width, right in aligned).rstrip()


def _text(shown: object) -> str:
    return "" if shown is None else plain(shown) if isinstance(shown, float) else str(shown)


def _numbers(head: str, cell: Any) -> Mapping[str, Any]:
    """Return the numbers of a cell by their columns."""
    if cell is None:
        return {}
    name = re.sub(r"\W+", "_", head).strip("_").lower()
    numbers = {name: cell}
    if isinstance(cell, Cell):
        numbers = cell.numbers
    elif hasattr(cell, "std"):
        numbers = {name: cell.value, "std" if name == "value" else f"{name}_std": cell.std}
    # An array of one number in an array library becomes that number.
    return {name: getattr(value, "tolist", lambda value=value: value)() for name, value in numbers.items()}


def _html_row(tag: str, cells: Sequence[str], styles: Sequence[str]) -> str:
    """Return a row of an HTML table; `tag` is th or td."""
    nowrap = lambda cell: ";white-space:nowrap" if tag == "td" and len(cell) <= _UNBROKEN else ""
    pairs = zip(cells, styles, strict=True)
    inner = "".join(f'<{tag} style="text-align:{align}{nowrap(cell)}">{escape(cell)}</{tag}>' for cell, align in pairs)
    return f"<tr>{inner}</tr>"


def dataframe(numbers: Any, units: Mapping[str, str]) -> "DataFrame":
    """Make a data frame of pandas with units.

    Args:
        numbers: arrays by column, or a list of rows, each a mapping by column.
        units: SI units by column, which become ``attrs["units"]``.

    Examples:
        >>> from fricjax.show.tables import dataframe
        >>> dataframe({"t": [0.0, 0.1], "x": [0.0, 2e-3]}, {"t": "s", "x": "m"}).attrs
        {'units': {'t': 's', 'x': 'm'}}
    """
    import pandas as pd

    frame = pd.DataFrame(numbers)
    frame.attrs["units"] = dict(units)
    return frame


class Variable(NamedTuple):
    """One array of a data set.

    Attributes:
        dims: names of its axes.
        values: its numbers, or texts.
        unit: SI unit; empty: none.
        meaning: description in words.
    """

    dims: str | Sequence[str]
    values: Any
    unit: str = ""
    meaning: str = ""


def dataset(variables: Mapping[str, Variable], coordinates: Mapping[str, Variable], **facts: Any) -> Any:
    """Make a data set of xarray that netCDF can hold.

    Units and meanings become attributes of each variable.

    Args:
        variables: the arrays by name.
        coordinates: the arrays along the axes, by name.
        **facts: attributes of the data set: texts, numbers, and sequences of texts, which become lines.

    Raises:
        UsageError: xarray is not installed; the message names the package to install.

    Examples:
        >>> from fricjax.show.tables import Variable, dataset
        >>> time = Variable("t", [0.0, 0.1], "s")
        >>> made = dataset({"x": Variable("t", [0.0, 2e-3], "m")}, {"t": time}, source="run.csv")
        >>> made["x"].attrs["units"], made["x"].sel(t=0.1).item()
        ('m', 0.002)
    """
    import numpy as np

    xarray = needed("A data set", "xarray", "interchange")

    def labelled(variable: Variable) -> tuple[Any, Any, dict[str, str]]:
        texts = {"units": variable.unit, "long_name": variable.meaning}
        return variable.dims, np.asarray(variable.values), {name: text for name, text in texts.items() if text}

    attributes = {name: "\n".join(fact) if isinstance(fact, list | tuple) else fact for name, fact in facts.items()}
    return xarray.Dataset(
        {name: labelled(each) for name, each in variables.items()},
        {name: labelled(each) for name, each in coordinates.items()},
        # netCDF has no booleans.
        {name: int(fact) if isinstance(fact, bool) else fact for name, fact in attributes.items()},
    )
