"""Records in Parquet files.

Columns are read one by one. Metadata from pandas are treated as plain data.
"""

import functools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from pyarrow import parquet, types

from ...errors import DataError
from .choice import Choice
from .header import first_word, split_title
from .sheet import Column, Sheet
from .tables import seconds_of

# Names of a column with the run of each row, in a table with several runs one below the other.
_LABELS = frozenset(("run", "trial", "shot", "messung", "lauf", "versuch", "essai"))
# Largest number of runs in a table; each is a span of rows.
_MOST_RUNS = 10_000


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open a `.parquet` file.

    The unit of a column is that of its metadata `units`, else of the `attrs` that pandas stores, else of its name. If
    the runs follow each other in one table, the column "run" labels them.
    """
    with parquet.ParquetFile(path) as file:
        yield _sheet(path, file)


def _sheet(path: Path, file: Any) -> Sheet:
    """Return the columns of the table, once for each run."""
    units = _units(file.schema_arrow)
    columns = [_column(field, units) for field in file.schema_arrow if field.type.num_fields == 0]

    @functools.lru_cache(maxsize=8)
    def values(name: str) -> np.ndarray:
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
    load = lambda wanted: [values(name)[span] for name, span in (column.key for column in wanted)]
    return Sheet(columns, load, lambda i: f"row {i + 1}", of="column")


def _units(schema: Any) -> Mapping[str, Any]:
    """Return units by column from the `attrs` that pandas stores."""
    about = schema.pandas_metadata or {}
    attrs = about.get("attributes") if isinstance(about, dict) else None
    units = attrs.get("units") if isinstance(attrs, dict) else None
    return units if isinstance(units, dict) else {}


def _column(field: Any, units: Mapping[str, Any]) -> Column:
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
    if pyarrow.types.is_decimal(column.type):
        column = column.cast(pyarrow.float64())
    values = column.to_numpy()
    return values.astype(np.float64) if (seconds := seconds_of(values)) is None else seconds


def _spans(path: Path, file: Any, name: str) -> dict[str, slice]:
    """Return the contiguous rows of each run by its label."""
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
