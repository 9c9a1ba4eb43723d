"""Records from objects in memory: tables, series and arrays.

Each object becomes named columns with units. Time and displacement are then selected by name and unit, as for a text
file.
"""

import numbers
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError, UsageError
from ..record import Record
from ..trace import Trace
from .assemble import assemble, records_of, with_choice
from .choice import Choice
from .choose import Samples
from .sheet import Column, Sheet
from .tables import Cells, column_of, floats_of, header_of, is_vector, table_columns

_PLACE = lambda i: f"row {i} (the first is 0)"


def memory_reader(source: Any) -> tuple[Callable[..., Any], str]:
    """Return the reader for an object, and its kind for messages."""
    if isinstance(source, Record | Trace):
        return _read_record, "records"
    if is_pair(source):
        return _read_pair, "times and displacements"
    if is_table(source):
        return _read_table, "tables"
    if is_numbers(source):
        return _read_array, "arrays"
    if isinstance(source, list | tuple):
        raise UsageError(
            f"read takes one run, got a {type(source).__name__} of {len(source)}. Write a tuple (t, x) for times and "
            "displacements, and [fricjax.read(run) for run in runs] for several runs."
        )
    raise UsageError(
        f"A record cannot be made of {type(source).__name__}. Give a path, a record, a pandas table or series, times "
        "and displacements as a tuple (t, x), or displacements with their rate, fricjax.read(x, rate=5000.0)."
    )


def is_pair(source: Any) -> bool:
    """Return True for a tuple of times and displacements."""
    return isinstance(source, tuple) and len(source) == 2 and all(map(_is_array, source))


def _is_array(source: Any) -> bool:
    if isinstance(source, list | tuple):
        return is_numbers(source)
    return hasattr(source, "__array__") and not hasattr(source, "columns") and is_vector(source)


def is_numbers(source: Any) -> bool:
    """Return True for an array or a list of numbers."""
    if isinstance(source, list | tuple):
        first: Any = source[0] if source else None
        return isinstance(first, numbers.Number) or (hasattr(first, "__array__") and np.ndim(first) == 0)
    return hasattr(source, "__array__") or hasattr(source, "magnitude")


def is_table(source: Any) -> bool:
    """Return True if an object has named columns.

    Examples are tables of pandas or polars, series, dicts and xarray objects.
    """
    series = hasattr(source, "index") and hasattr(source, "to_numpy")
    labelled = hasattr(source, "coords") and hasattr(source, "dims")
    structured = getattr(getattr(source, "dtype", None), "names", None) is not None
    return isinstance(source, Mapping) or hasattr(source, "columns") or series or labelled or structured


def _read_record(source: Record | Trace, *, sigma: Any = None, sign: int = 1) -> Record:
    """Return a record, with new noise or direction if given."""
    record = source if isinstance(source, Record) else Record(source)
    return with_choice(record, Choice(sigma=sigma, sign=sign))


def _read_table(source: Any, choice: Choice) -> Record | list[Record]:
    """Read a table by the rules for files."""
    kind, name = type(source).__name__, getattr(source, "attrs", {}).get("source")
    # The index comes last, so that numbers refer to the columns of the table.
    cells = sorted(table_columns(source), key=lambda column: column.is_index)
    columns = [
        Column(column.name, column.unit, column.run, column.header, fault=column.fault, key=i)
        for i, column in enumerate(cells)
    ]
    load = lambda wanted: [floats_of(cells[column.key], kind) for column in wanted]
    records = records_of(Path(kind), kind, Sheet(columns, load, _PLACE), choice)
    return [_of(record, name) for record in records] if isinstance(records, list) else _of(records, name)


def _read_pair(
    source: tuple[Any, Any],
    *,
    unit: str | None = None,
    time_unit: str | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Read times and displacements; default units are s and m."""
    t, x = (column_of(values, header_of(values, header)) for values, header in zip(source, ("t", "x"), strict=True))
    return _read_arrays(t, x, Choice(unit=unit, time_unit=time_unit, sigma=sigma, sign=sign))


def _read_array(
    source: Any,
    *,
    t: Any = None,
    rate: float | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Read displacements with separate times or a rate."""
    x = column_of(source, header_of(source, "x"))
    if (t is None) == (rate is None):
        raise UsageError(
            "An array is read as displacements, and needs either their rate or their times: a tuple (t, x), "
            "fricjax.read(x, rate=5000.0) or fricjax.fit(x, ..., rate=5000.0)."
        )
    choice = Choice(unit=unit, time_unit=time_unit, rate=rate, sigma=sigma, sign=sign)
    return _read_arrays(None if t is None else column_of(t, header_of(t, "t")), x, choice)


def _read_arrays(t: Cells | None, x: Cells, choice: Choice) -> Record:
    if t is not None and t.values.size != x.values.size:
        raise DataError(f"There are {t.values.size} times and {x.values.size} displacements; give as many of each.")
    # Bare numbers are in SI units by definition, so no warning is needed.
    column = Column(x.name, x.unit or (None if choice.unit else "m"))
    time = None if t is None else Column(t.name, t.unit or (None if choice.time_unit else "s"))
    times = None if t is None else floats_of(t, "array")
    samples = Samples(column, floats_of(x, "array"), time, times, _PLACE)
    return _of(assemble(Path("array"), "array", samples, choice), None)


def _of(record: Record, source: str | None) -> Record:
    """Return the record with the source that its table names."""
    return Record(record.trace, {**record.meta, "source": source}, record.log)
