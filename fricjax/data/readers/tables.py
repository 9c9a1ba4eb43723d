"""Named columns of tables in memory, from pandas, xarray, pint or numpy.

The libraries are not imported: objects are recognised by their attributes.
"""

import dataclasses
import datetime
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import DataError, UsageError
from .fields import number
from .header import split_title

_SAMPLED = 1000  # number of cells that decide if a column is numeric


@dataclasses.dataclass(frozen=True)
class Cells:
    """One column of a table: header, name, unit, run and values.

    The index of a table (`is_index`) may be the time. It is the displacement only if the caller names it.
    """

    header: str
    name: str
    unit: str | None
    run: str | None
    values: np.ndarray
    is_index: bool = False

    @property
    def fault(self) -> str | None:
        """The reason why it is neither displacement nor time, or None."""
        if self.values.dtype.kind == "c":
            return "holds complex numbers"
        if self.values.dtype.kind in "fiu":
            return "is empty" if np.all(np.isnan(self.values)) else None
        cells = [_number(cell) for cell in self.values[:_SAMPLED]] if self.values.dtype.kind in "OUT" else []
        # A single word between numbers is reported with its row later; a column of words is excluded here.
        return None if any(cell is not None and cell == cell for cell in cells) else "holds words"


def table_columns(source: Any) -> list[Cells]:
    """Return the columns of a table, a usable index first."""
    if hasattr(source, "coords") and hasattr(source, "dims"):
        variables = source.data_vars if hasattr(source, "data_vars") else {}
        values = [] if variables else [column_of(source, header_of(source, "x"))]
        return [*_vectors({**source.coords, **variables}), *values]
    if isinstance(source, Mapping):
        return _vectors(source)
    if not hasattr(source, "columns"):
        names = getattr(source.dtype, "names", None)
        if names:
            return _vectors({name: source[name] for name in names})
        return [*_index(source, ()), column_of(source, header_of(source, "x"))]
    headers = list(source.columns)
    several = next((header for header in headers if isinstance(header, tuple)), None)
    if several is not None:
        raise DataError(
            f"The columns of the table have several levels, as {several} has; take one, table[{several[0]!r}]."
        )
    twice = next((header for header in headers if headers.count(header) > 1), None)
    if twice is not None:
        raise DataError(f"The table has the column {twice!r} more than once; rename or drop one of them.")
    return [*_index(source, headers), *(column_of(source[header], str(header)) for header in headers)]


def _vectors(named: Mapping[Any, Any]) -> list[Cells]:
    """Return the one-dimensional arrays among named arrays."""
    return [column_of(values, str(name)) for name, values in named.items() if is_vector(values)]


def is_vector(values: Any) -> bool:
    """Return True for one run's values, also as single row or column."""
    try:
        return np.ndim(np.squeeze(values)) == 1
    except ValueError:  # rows of different lengths
        return False


def _index(table: Any, headers: Sequence[Any]) -> list[Cells]:
    """Return the index of a pandas table, unless it only counts rows."""
    index = getattr(table, "index", None)
    if index is None or getattr(index, "nlevels", 1) > 1 or (index.name is not None and index.name in headers):
        return []
    column = dataclasses.replace(column_of(index, header_of(index, "index")), is_index=True)
    if index.name is None and column.values.dtype.kind == "f":
        # Such an index must be a time, because a row counter has no decimals.
        column = dataclasses.replace(column, unit="s")
    return [column] if index.name is not None or column.unit else []


def header_of(values: Any, otherwise: str) -> str:
    """Return the name that values carry, as a series does."""
    name = getattr(values, "name", None)
    return name if isinstance(name, str) and name else otherwise


def column_of(values: Any, header: str) -> Cells:
    """Return values with name and unit from header, attributes or values."""
    name, unit, run = split_title(header)
    stated = getattr(values, "attrs", {}).get("units")
    stated = stated.get(header) if isinstance(stated, Mapping) else stated
    unit = unit or (stated if isinstance(stated, str) and stated else None)
    if hasattr(values, "magnitude"):
        values, unit = values.magnitude, str(values.units)
    array = _vector(values, name)
    seconds = seconds_of(array)
    return Cells(header, name, unit if seconds is None else "s", run, array if seconds is None else seconds)


def _vector(values: Any, name: str) -> np.ndarray:
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    array = np.asarray(values)
    array = array.ravel() if array.ndim == 2 and 1 in array.shape else array
    if array.ndim == 1:
        return array
    if array.ndim == 2 and 2 in array.shape:
        first, second = ("a[:, 0]", "a[:, 1]") if array.shape[-1] == 2 else ("a[0]", "a[1]")
        raise UsageError(
            f"Is the array of shape {array.shape} a run or two? Write ({first}, {second}) for times and displacements, "
            f"or read each separately, fricjax.read({second}, rate=5000.0)."
        )
    rows = f", or its rows as runs to a fit, fricjax.fit_batch({name}, ..., rate=5000.0)" if array.ndim == 2 else ""
    raise UsageError(f"'{name}' must be one-dimensional, but it has shape {array.shape}; give one run at a time{rows}.")


def seconds_of(array: np.ndarray) -> np.ndarray | None:
    """Convert durations or dates to seconds, shape (n,).

    Dates count from the first one. Returns None for other types.
    """
    if array.dtype.kind in "mM":
        return (array - array[:1] if array.dtype.kind == "M" else array) / np.timedelta64(1, "s")
    first = array[0] if array.dtype.kind == "O" and array.size else None
    if isinstance(first, datetime.datetime | datetime.timedelta):
        spans = (each - first if isinstance(first, datetime.datetime) else each for each in array)
        return np.array([span.total_seconds() for span in spans])
    return None


def floats_of(column: Cells, kind: str) -> np.ndarray:
    """Return the numbers of a column; missing cells are NaN."""
    if column.values.dtype.kind == "c":
        raise DataError(
            f"{kind} holds complex numbers in '{column.header}', but a displacement is real; take their real part."
        )
    if column.values.dtype.kind in "fiub":
        return column.values.astype(np.float64)
    cells = [_number(cell) for cell in column.values]
    if None in cells:
        i = cells.index(None)
        raise DataError(
            f"{kind}, column '{column.header}', row {i} (the first is 0): {column.values[i]!r} is not a number; repair "
            "the cell or leave it empty."
        )
    return np.array(cells, dtype=np.float64)


def _number(cell: Any) -> float | None:
    """Parse a cell: NaN if missing, None if not a number."""
    if isinstance(cell, str):
        return number(cell.strip(), ".")
    # Missing values of pandas equal no other value. Recognise them by the type name, because pandas is not imported.
    if cell is None or type(cell).__name__ in ("NAType", "NaTType"):
        return float("nan")
    try:
        return float(cell)
    except (TypeError, ValueError):
        return None
