"""A small table: column heads, rows of cells, a title. The same table is printed in a terminal and in a notebook.

Columns whose cells all begin like a number are right-aligned, so that magnitudes can be compared by eye. Results that
hold arrays give them with names and units too, as data sets of xarray.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import needed
from .numbers import plain

if TYPE_CHECKING:
    from pandas import DataFrame

_NUMERIC = re.compile(r"\s*([-+−±\[]?\.?\d|inf\b|nan\b|undetermined\b|-?$)")
# A number, a unit or an interval so short stays in one line; a browser would break it at its sign or blank.
_UNBROKEN = 28


@dataclass(frozen=True)
class Table:
    """Rows under column heads.

    Attributes:
        columns: the heads, with units where the cells carry none, e.g. "Displacement [mm]".
        rows: one sequence of cells per row, each as long as `columns`; text is shown as it is, a float through
            `plain`, None as an empty cell, anything else, such as a `Measured`, as its own text.
        title: a line above the table; empty: none.

    Examples:
        >>> from fricjax.rig import Measured
        >>> from fricjax.show import Table
        >>> print(Table(["coefficient", "value"], [["mu", Measured(0.214523, 0.000312)]]))
        coefficient        value
        ───────────  ───────────
        mu           0.21452(31)
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    title: str = ""

    def __post_init__(self) -> None:
        """Refuses a row that does not fit the heads."""
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(f"Row {index} has {len(row)} cells under {len(self.columns)} columns: {list(row)!r}.")

    def text(self) -> str:
        """The table as aligned plain text, without a newline at the end."""
        cells = [list(self.columns), *self.cells()]
        widths = [max(len(row[i]) for row in cells) for i in range(len(self.columns))]
        lines = [self._line(row, widths) for row in cells]
        rule = "  ".join("─" * width for width in widths)
        return "\n".join(([self.title] if self.title else []) + [lines[0], rule, *lines[1:]])

    def html(self) -> str:
        """The table as an HTML fragment; every cell is escaped."""
        styles = ["right" if numeric else "left" for numeric in self.numeric()]
        caption = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        head = _html_row("th", self.columns, styles)
        body = "".join(_html_row("td", row, styles) for row in self.cells())
        return f"<table>{caption}<thead>{head}</thead><tbody>{body}</tbody></table>"

    def to_dataframe(self) -> "DataFrame":
        """The cells as they are, with all their digits; a value with its uncertainty takes two columns, `NAME std`."""
        import pandas as pd

        columns: dict[str, list[object]] = {}
        for head, cells in zip(self.columns, zip(*self.rows, strict=True), strict=True):
            columns[head] = [getattr(cell, "value", cell) for cell in cells]
            if any(hasattr(cell, "std") for cell in cells):
                columns[f"{head} std".strip()] = [getattr(cell, "std", None) for cell in cells]
        return pd.DataFrame(columns)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        return self.html()

    def cells(self) -> list[list[str]]:
        """The cells as they are shown."""
        shown = lambda cell: "" if cell is None else plain(cell) if isinstance(cell, float) else str(cell)
        return [[shown(cell) for cell in row] for row in self.rows]

    def numeric(self) -> list[bool]:
        """For each column whether its cells are numbers, which are aligned to the right."""
        cells = self.cells()
        return [bool(cells) and all(_NUMERIC.match(row[i]) for row in cells) for i in range(len(self.columns))]

    def _line(self, row: Sequence[str], widths: Sequence[int]) -> str:
        aligned = zip(row, widths, self.numeric(), strict=True)
        return "  ".join(cell.rjust(width) if right else cell.ljust(width) for cell, width, right in aligned).rstrip()


def _html_row(tag: str, cells: Sequence[str], styles: Sequence[str]) -> str:
    """One row of an HTML table; `tag` is th or td."""
    nowrap = lambda cell: ";white-space:nowrap" if tag == "td" and len(cell) <= _UNBROKEN else ""
    pairs = zip(cells, styles, strict=True)
    inner = "".join(f'<{tag} style="text-align:{align}{nowrap(cell)}">{escape(cell)}</{tag}>' for cell, align in pairs)
    return f"<tr>{inner}</tr>"


class Variable(NamedTuple):
    """One array of a data set.

    Attributes:
        dims: names of its axes.
        values: its numbers, or texts.
        unit: SI unit; empty: none.
        meaning: what it is, in words.
    """

    dims: str | Sequence[str]
    values: Any
    unit: str = ""
    meaning: str = ""


def dataset(variables: Mapping[str, Variable], coordinates: Mapping[str, Variable], **facts: Any) -> Any:
    """A data set of xarray that netCDF can hold: units and meanings as attributes of each variable.

    Args:
        variables: the arrays by name.
        coordinates: those that count along the axes.
        **facts: attributes of the whole: texts, numbers, and sequences of texts, which become lines.

    Raises:
        UsageError: xarray is not installed; the sentence says how to.

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
        # netCDF knows no truth values.
        {name: int(fact) if isinstance(fact, bool) else fact for name, fact in attributes.items()},
    )
