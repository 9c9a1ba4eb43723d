"""From what a program holds in memory to a record: tables, series and arrays are read as files are.

Whatever it is becomes named columns with units, of which time and displacement are chosen by name and unit as in a text
file, and given to `assemble`.
"""

import dataclasses
import numbers
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .assemble import Choice, Columns, assemble
from .choose import displacement_index, locate, time_index
from .columns import Column, column_of, floats_of, header_of, is_vector, table_columns
from .errors import DataError, UsageError
from .record import Record
from .trace import Trace


def memory_reader(source: Any) -> tuple[Callable[..., Record], str]:
    """The reader of an object in memory, and what messages call its kind.

    Raises:
        UsageError: nothing that a record can be made of, or several runs at once.
    """
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
    """Whether an object is a tuple of times and displacements."""
    return isinstance(source, tuple) and len(source) == 2 and all(map(_is_array, source))


def _is_array(source: Any) -> bool:
    if isinstance(source, list | tuple):
        return is_numbers(source)
    return hasattr(source, "__array__") and not hasattr(source, "columns") and is_vector(source)


def is_numbers(source: Any) -> bool:
    """Whether an object is an array, or a list of numbers."""
    if isinstance(source, list | tuple):
        first: Any = source[0] if source else None
        return isinstance(first, numbers.Number) or (hasattr(first, "__array__") and np.ndim(first) == 0)
    return hasattr(source, "__array__") or hasattr(source, "magnitude")


def is_table(source: Any) -> bool:
    """Whether an object has named columns: a table of pandas or polars, a series, a dict, an array of xarray."""
    series = hasattr(source, "index") and hasattr(source, "to_numpy")
    labelled = hasattr(source, "coords") and hasattr(source, "dims")
    structured = getattr(getattr(source, "dtype", None), "names", None) is not None
    return isinstance(source, Mapping) or hasattr(source, "columns") or series or labelled or structured


def _read_record(source: Record | Trace, *, sigma: Any = None, sign: int = 1) -> Record:
    """A record as it is, or with another noise or direction; a trace becomes one."""
    record = source if isinstance(source, Record) else Record(source)
    return Choice(sigma=sigma, sign=sign).applied(record)


def _read_table(
    source: Any,
    *,
    column: str | int | None = None,
    time: str | int | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    rate: float | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Reads a table with named columns; the options are those of `fricjax.read`."""
    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    kind, told = type(source).__name__, getattr(source, "attrs", {})
    return _read(table_columns(source), kind, choice, told.get("source"))


def _read_pair(
    source: tuple[Any, Any],
    *,
    unit: str | None = None,
    time_unit: str | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Reads times and displacements, in s and m where neither they nor the options have units."""
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
    """Reads displacements whose times or rate are given beside them.

    Raises:
        UsageError: neither or both of `t` and `rate`.
    """
    x = column_of(source, header_of(source, "x"))
    if (t is None) == (rate is None):
        raise UsageError(
            "An array is read as displacements, and needs either their rate or their times: a tuple (t, x), or "
            "fricjax.read(x, rate=5000.0)."
        )
    choice = Choice(unit=unit, time_unit=time_unit, rate=rate, sigma=sigma, sign=sign)
    return _read_arrays(None if t is None else column_of(t, header_of(t, "t")), x, choice)


def _read_arrays(t: Column | None, x: Column, choice: Choice) -> Record:
    # Bare numbers are in SI units, of which nothing needs to be said.
    columns = [dataclasses.replace(x, unit=x.unit or (None if choice.unit else "m"))]
    if t is not None:
        columns.append(dataclasses.replace(t, unit=t.unit or (None if choice.time_unit else "s")))
    return _assembled(columns, 0, None if t is None else 1, "array", choice, None)


def _read(columns: list[Column], kind: str, choice: Choice, source: str | None) -> Record:
    """The record of the columns that are the time and the displacement by the rules of text files."""
    names, units = [column.name for column in columns], [column.unit for column in columns]
    x = None if choice.column is None else _located(choice.column, columns, kind, "column")
    if choice.time is not None:
        t = _located(choice.time, columns, kind, "time")
    else:
        t = time_index(names, units)
    usable = [i for i, column in enumerate(columns) if column.is_numeric and not column.is_index]
    if t is None and choice.rate is None:
        others = [i for i in usable if i != x]
        t = others[0] if others and len(usable) > 1 and others[0] < (len(names) if x is None else x) else None
    if x is None:
        candidates = [i for i in usable if i != t]
        if not candidates:
            raise DataError(f"{kind} holds no column of numbers beside its times; it has {', '.join(names) or 'none'}.")
        x = displacement_index(names, candidates, kind)
    if x == t and choice.time is None:
        t = None
    return _assembled(columns, x, None if choice.rate is not None else t, kind, choice, source)


def _located(wanted: str | int, columns: list[Column], kind: str, what: str) -> int:
    """Index of the column with this header, name or place."""
    headers = [column.header for column in columns]
    if wanted in headers:
        return headers.index(wanted)  # pyright: ignore[reportArgumentType]
    ahead = sum(column.is_index for column in columns)
    return ahead + locate(wanted, [column.name for column in columns[ahead:]], kind, what)


def _assembled(columns: list[Column], x: int, t: int | None, kind: str, choice: Choice, source: str | None) -> Record:
    clock = None if t is None else columns[t]
    found = Columns(
        x=floats_of(columns[x], kind),
        time=None if clock is None else floats_of(clock, kind),
        x_name=columns[x].name,
        time_name="time" if clock is None else clock.name,
        x_unit=columns[x].unit,
        time_unit=None if clock is None else clock.unit,
        place=lambda i: f"row {i} (the first is 0)",
    )
    record = assemble(Path(kind), kind, found, choice, vars(choice))
    return Record(record.trace, {**record.meta, "source": source}, record.log)
