"""Small tables of numbers as text, whose first columns have a fixed meaning: receptances, pairs of displacements."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import DataError, brief
from .files import check_regular
from .readers.dialect import Dialect, Layout, sniff
from .readers.fields import number, split
from .readers.text import Text
from .units import si_unit


def read_table(path: str | Path, columns: Mapping[str, str], *, what: str) -> dict[str, np.ndarray]:
    """Read the first columns of a text table in SI units.

    Args:
        path: the file; delimiter, decimal mark and header are found.
        columns: what the columns hold, in order, and the SI unit of each; units in the header, as in ``x0 [um]``, are
            converted.
        what: what the table is, for the messages.

    Returns:
        Each column by its name in `columns`, shape (rows,).

    Raises:
        DataError: no such file, too few columns, a row that is no number, or a unit that does not fit.
    """
    path = Path(path)
    try:
        check_regular(path)
        text = Text.of(path)
        lines = list(text.lines())
    except OSError as error:
        raise DataError(f"The file '{path}' cannot be read: {error.strerror}. Check the path.") from error
    layout = sniff(text.head, Dialect(), path.name)
    if len(layout.names) < len(columns):
        raise DataError(
            f"{path.name} has {len(layout.names)} column(s); {what} needs {len(columns)}: {', '.join(columns)}."
        )
    rows = [
        _row(path, i + 1, line, layout, len(columns)) for i, line in enumerate(lines) if _holds_data(i, line, layout)
    ]
    table = np.array(rows) * [_factor(path, layout, i, *column, what) for i, column in enumerate(columns.items())]
    return dict(zip(columns, table.T, strict=True))


def _holds_data(i: int, line: str, layout: Layout) -> bool:
    return i >= layout.first_line and Dialect().holds_data(line)


def _row(path: Path, place: int, line: str, layout: Layout, columns: int) -> list[float]:
    """The numbers of a line."""
    fields = split(line, layout.delimiter)[:columns]
    values = [number(field, layout.decimal) for field in fields]
    if len(values) < columns or any(value is None or not np.isfinite(value) for value in values):
        raise DataError(
            f"{path.name}, row {place}: {brief(line.strip())} does not hold {columns} numbers; repair the row."
        )
    return [float(value) for value in values if value is not None]


def _factor(path: Path, layout: Layout, place: int, name: str, target: str, what: str) -> float:
    """What one unit of a column is in SI units."""
    unit = layout.units[place]
    if unit is None:
        return 1.0
    found, goal = si_unit(unit), si_unit(target)
    if found is None or goal is None or found[1] != goal[1]:
        raise DataError(
            f"{path.name}: the unit '{unit}' does not fit the {name} of {what}; use for example '{target}'."
        )
    return found[0]
