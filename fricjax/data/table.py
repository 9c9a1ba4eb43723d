"""Small numeric text tables with fixed columns: receptances, pairs of displacements."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import DataError, brief
from .files import check_regular
from .readers.csv import TextTable
from .readers.dialect import Dialect
from .readers.fields import number, split
from .readers.text import Text
from .units import si_unit


def read_table(path: str | Path, columns: Mapping[str, str], *, what: str) -> dict[str, np.ndarray]:
    """Read the first columns of a text table in SI units.

    The function detects delimiter, decimal mark and header of the file, and converts units in the header, as in
    ``x0 [um]``. `columns` gives the name and the SI unit of each column, in order. Messages refer to the file by the
    last argument, such as "a receptance".

    Returns:
        Each column by its name in `columns`, shape (rows,).

    Raises:
        DataError: no such file, too few columns, a row that is not numeric, or a unit that does not fit.
    """
    path = Path(path)
    try:
        check_regular(path)
        table = TextTable.of(Text.of(path), Dialect(), path.name)
    except OSError as error:
        raise DataError(f"The file '{path}' cannot be read: {error.strerror}. Check the path.") from error
    layout, width = table.layout, len(columns)
    if len(layout.titles) < width:
        raise DataError(f"{path.name} has {len(layout.titles)} column(s); {what} needs {width}: {', '.join(columns)}.")
    rows = []
    for row, line in table.rows():
        values = [number(field, layout.decimal) for field in split(line, layout.delimiter)[:width]]
        if len(values) < width or any(value is None or not np.isfinite(value) for value in values):
            raise DataError(
                f"{path.name}, row {row}: {brief(line.strip())} does not hold {width} numbers; repair the row."
            )
        rows.append(values)
    titles = zip(layout.titles, columns.items(), strict=False)
    factors = [_factor(path, title.unit, *column, what) for title, column in titles]
    return dict(zip(columns, (np.array(rows, dtype=np.float64) * factors).T, strict=True))


def _factor(path: Path, unit: str | None, name: str, target: str, what: str) -> float:
    """Return the factor from a column's unit to SI."""
    if unit is None:
        return 1.0
    known, expected = si_unit(unit), si_unit(target)
    if known is None or expected is None or known[1] != expected[1]:
        raise DataError(
            f"{path.name}: the unit '{unit}' does not fit the {name} of {what}; use for example '{target}'."
        )
    return known[0]
