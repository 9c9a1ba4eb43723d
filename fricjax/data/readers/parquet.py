"""Records in Parquet files.

Columns are read one by one. Metadata from pandas are treated as plain data.
"""

import functools
import mmap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..files import NUMBER, check_size, damage, library
from ..record import Record
from .assemble import records_of
from .choice import Choice
from .header import first_word, split_title
from .sheet import Column, Sheet
from .tables import seconds_of
from .thrift import structure

# Names of a column with the run of each row, in a table with several runs one below the other.
_LABELS = frozenset(("run", "trial", "shot", "messung", "lauf", "versuch", "essai"))
# Largest size of the list of columns [bytes]; a thousand columns in a hundred row groups need about ten million.
_LONGEST_LIST = 1 << 24
# Field numbers in the format definition: of the list, of a row group, of a column chunk, of a page header (its unpacked
# and packed size).
_GROUPS, _CHUNKS, _ABOUT = 4, 1, 3
_PATH, _VALUES, _SIZE, _PACKED_SIZE, _PAGES, _DICTIONARY = 3, 5, 6, 7, 9, 11
_UNPACKED, _PACKED = 2, 3
# Largest number of runs in a table; each is a span of rows.
_MOST_RUNS = 10_000


def read_parquet(path: Path, choice: Choice) -> Record | list[Record]:
    """Read two columns of a `.parquet` file.

    Options as in `fricjax.read`, with

    - `unit`, `time_unit`: by default from the metadata `units` of a column, from the `attrs` that pandas stores, or
      from the name.
    - `run`: a label from the column "run", if the runs follow each other in one table.

    Raises:
        DataError: a damaged file, or no column of numbers.
        UsageError: the package pyarrow is not installed.
    """
    parquet = library(path, "pyarrow.parquet", "parquet")
    with damage(path, "Parquet"), parquet.ParquetFile(path) as file:
        return records_of(path, "parquet", _sheet(path, file), choice)


def _sheet(path: Path, file: Any) -> Sheet:
    """Return the columns of the table, once for each run."""
    units = _units(file.schema_arrow)
    columns = [_column(field, units) for field in file.schema_arrow if field.type.num_fields == 0]

    @functools.lru_cache(maxsize=8)
    def values(name: str) -> np.ndarray:
        _check_declared(path, name)
        return _numbers(file.read([name]).column(name))

    label = next((each for each in columns if first_word(each.name) in _LABELS), None)
    spans = {} if label is None else _spans(path, file, label.key[0])
    if len(spans) > 1:
        columns = [column for column in columns if column is not label]
        columns = [
            Column(c.name, c.unit, run, c.title, fault=c.fault, key=(c.key[0], span))
            for run, span in spans.items()
            for c in columns
        ]

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [values(name)[span] for name, span in (column.key for column in wanted)]

    return Sheet(columns, load, lambda i: f"row {i + 1}", of="column")


def _check_declared(path: Path, name: str) -> None:
    """Refuse a column with an implausible declared size or without pages.

    The library allocates as much memory as the head of a page declares, regardless of the list of columns.
    """
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        length = int.from_bytes(data[-8:-4], "little")
        if length > _LONGEST_LIST:
            raise DataError(f"{path.name} has {length >> 20} MB of columns; write time and displacement alone.")
        about, _ = structure(data[-8 - length : -8], 0)
        rows = unpacked = 0
        for chunk in (chunk[_ABOUT] for group in about[_GROUPS] for chunk in group[_CHUNKS]):
            if chunk[_PATH] != [name.encode()]:
                continue
            rows += chunk[_VALUES]
            check_size(path, f"'{name}'", max(rows, chunk[_SIZE] // NUMBER))
            place = min(filter(None, (chunk.get(_DICTIONARY), chunk[_PAGES])))
            end = place + chunk[_PACKED_SIZE]
            while place < end:
                head, place = structure(data, place)
                unpacked += head[_UNPACKED]
                check_size(path, f"'{name}'", unpacked // NUMBER)
                place += max(head[_PACKED], 0)


def _units(schema: Any) -> Mapping[str, Any]:
    """Return units by column from the `attrs` that pandas stores."""
    about = schema.pandas_metadata or {}
    attrs = about.get("attributes") if isinstance(about, dict) else None
    units = attrs.get("units") if isinstance(attrs, dict) else None
    return units if isinstance(units, dict) else {}


def _column(field: Any, units: Mapping[str, Any]) -> Column:
    from pyarrow import types

    # Pandas stores an index without a name under this name.
    header = "index" if field.name.startswith("__index_level_") else field.name
    title = split_title(header)
    about = field.metadata or {}
    stated = about.get(b"units", about.get(b"unit", b"")).decode("utf-8", "replace").strip() or units.get(field.name)
    unit = stated if isinstance(stated, str) and stated else title.unit
    key = (field.name, slice(None))
    if types.is_timestamp(field.type) or types.is_duration(field.type):
        return Column(title.name, "s", title.run, header, key=key)
    numbers = types.is_integer(field.type) or types.is_floating(field.type) or types.is_decimal(field.type)
    fault = None if numbers else "holds no numbers"
    return Column(title.name, unit, title.run, header, fault=fault, key=key)


def _numbers(column: Any) -> np.ndarray:
    """Return a column as numbers; missing entries are NaN.

    Dates and durations are in seconds.
    """
    import pyarrow

    if pyarrow.types.is_decimal(column.type):
        column = column.cast(pyarrow.float64())
    values = column.to_numpy()
    return values.astype(np.float64) if (seconds := seconds_of(values)) is None else seconds


def _spans(path: Path, file: Any, name: str) -> dict[str, slice]:
    """Return the rows of each run by its label.

    Raises:
        DataError: the rows of a run are not contiguous, or there are too many runs.
    """
    _check_declared(path, name)
    labels = file.read([name]).column(name).combine_chunks().dictionary_encode()
    codes = labels.indices.to_numpy(zero_copy_only=False)
    if codes.size == 0 or labels.null_count:
        return {}
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    if starts.size > _MOST_RUNS:
        raise DataError(f"{path.name} changes its '{name}' {starts.size} times; sort its rows by run and time.")
    if starts.size > len(labels.dictionary):
        raise DataError(f"In {path.name} the rows of one '{name}' lie apart; sort them by run and time.")
    stops = np.append(starts[1:], codes.size)
    labels = [str(labels.dictionary[int(codes[start])].as_py())[:80] for start in starts]
    # A bare number is prefixed with the name of its column: "run 3".
    names = [f"{name} {label}" if label.isdecimal() else label for label in labels]
    return {label: slice(int(a), int(b)) for label, a, b in zip(names, starts, stops, strict=True)}
