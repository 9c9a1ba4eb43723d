"""Table of an archive: columns, rows, and merging of parts.

There is one row for each run and law. The parameter columns depend on the law; missing values are null. The residuals
of a run are a separate file with the identity of the run in its attributes.
"""

import io
import json
import math
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..errors import needed
from ..show.tables import Variable, dataset
from .study import SCHEMA

# Columns with their Arrow types; a list holds the short series of a picture.
_BEFORE = dict.fromkeys(("key", "file", "run", "friction", "status", "outcome", "warnings"), "string")
_AFTER = {
    **dict.fromkeys(("chi2_reduced", "residual_rms", "sigma", "numerical_shift"), "float64"),
    **dict.fromkeys(("half_cycles", "iterations", "passes"), "int64"),
    **dict.fromkeys(("engine", "noise", "quantity"), "string"),
    "samples": "int64",
    **dict.fromkeys(("rate", "duration", "amplitude"), "float64"),
    "measured_at": "string",
    "load": "float64",
    "rig": "string",
}
_PICTURES = ("sketch_t", "sketch_x", "sketch_residual", "reversal_t", "reversal_x")
_LAST = {
    **dict.fromkeys(_PICTURES, "list"),
    "sha256": "string",
    "bytes": "int64",
    "modified": "string",
    "inode": "int64",
    "settings": "string",
    **dict.fromkeys(("seconds_read", "seconds_fit"), "float64"),
    **dict.fromkeys(("finished_at", "fricjax", "jax", "python", "host", "worker"), "string"),
}
STATUSES = ("ok", "invalid", "rejected", "failed")
"""Status of a run: valid fit, fit that should not be trusted, no valid data, or unexpected error."""
COLUMNS = (*_BEFORE, *_AFTER, *_LAST)
"""Columns of every table; those of parameters and facts are placed between them."""
REMEMBERED = ("file", "status", "settings", "sha256", "bytes", "modified", "inode")
"""Columns that a plan needs."""
_PARTS = b"fricjax.parts"
_FACTS = b"fricjax.facts"


def arrow() -> Any:
    """Import pyarrow.

    Raises:
        UsageError: pyarrow is not installed.
    """
    needed("An archive", "pyarrow.parquet", "batch")
    return needed("An archive", "pyarrow", "batch")


def of_rows(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Convert rows to an Arrow table; parameter columns keep their order."""
    pa = arrow()
    named = dict.fromkeys(name for row in rows for name in row)
    parameters = {name: "float64" for name in named if name not in COLUMNS}
    types = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64(), "list": pa.list_(pa.float32())}
    kinds = {**_BEFORE, **parameters, **_AFTER, **_LAST}
    columns = [pa.array([row.get(name) for row in rows], types[kind]) for name, kind in kinds.items()]
    return pa.table(columns, pa.schema(list(zip(kinds, (types[k] for k in kinds.values()), strict=True))))


def joined(
    tables: Sequence[tuple[str, Any]], facts_of: Callable[[str], Mapping[str, str]], root: str | None = None
) -> Any:
    """Merge parts, keeping the newest rows of each file and law.

    The rows are sorted by file.

    Args:
        tables: the parts with their names, from oldest to newest.
        facts_of: function that extracts facts from a path.
        root: the folder of the files. If a file is missing there and its bytes exist under another path, it was moved,
            and its records are dropped.
    """
    pa = arrow()
    origin = [number for number, (_, table) in enumerate(tables) for _ in range(table.num_rows)]
    bare = [table.drop_columns([n for n in _facts(table) if n in table.column_names]) for _, table in tables]
    full = pa.concat_tables([table.replace_schema_metadata() for table in bare], promote_options="default")
    places, laws, keys = (full.column(name).to_pylist() for name in ("file", "friction", "key"))
    newest = {(file, law): number for file, law, number in zip(places, laws, origin, strict=True)}
    kept = [i for i, number in enumerate(origin) if newest[places[i], laws[i]] == number]
    copies = Counter(keys[i] for i in kept)
    if root is not None:
        gone = lambda i: copies[keys[i]] > 1 and not os.path.lexists(os.path.join(root, places[i]))
        kept = [i for i in kept if not gone(i)]
    kept.sort(key=lambda i: (places[i], laws[i]))
    table = full.take(pa.array(kept, pa.int64()))
    of_facts = _fact_columns([facts_of(file) for file in table.column("file").to_pylist()])
    for name, values in of_facts.items():
        if name not in table.column_names:
            table = table.append_column(name, pa.array(values))
    facts = [name for name in of_facts if name not in full.column_names]
    parameters = [name for name in full.column_names if name not in COLUMNS]
    table = table.select([*_BEFORE, *parameters, *_AFTER, *facts, *_LAST])
    names = [name for part, each in tables for name in (parts_in(each) or [part])]
    notes = {b"schema": SCHEMA.encode(), _PARTS: json.dumps(names).encode(), _FACTS: json.dumps(facts).encode()}
    return table.replace_schema_metadata(notes)


def parts_in(table: Any) -> list[str]:
    """Return the names of the merged parts, empty for a part."""
    return json.loads((_metadata(table)).get(_PARTS, b"[]"))


def _facts(table: Any) -> list[str]:
    return json.loads(_metadata(table).get(_FACTS, b"[]"))


def _metadata(table: Any) -> Mapping[bytes, bytes]:
    return table.schema.metadata or {}


def _fact_columns(facts: Sequence[Mapping[str, str]]) -> dict[str, list[Any]]:
    """Return a column for each fact, numeric if all values are numbers."""
    columns: dict[str, list[Any]] = {}
    for name in dict.fromkeys(name for row in facts for name in row):
        texts = [row.get(name) for row in facts]
        numbers = [_number(text) for text in texts]
        numeric = all(number is not None for number, text in zip(numbers, texts, strict=True) if text is not None)
        columns[name] = numbers if numeric else texts
    return columns


def _number(text: str | None) -> float | None:
    try:
        number = float("nan" if text is None else text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def netcdf(row: Mapping[str, Any], samples: Any) -> bytes:
    """Return times, displacements and residuals of a run as netCDF-4.

    Args:
        row: row of the run in the table, for the attributes.
        samples: sketch of all its samples.

    Raises:
        UsageError: a package is not installed.
    """
    needed("A file of residuals", "h5netcdf", "batch")
    unit = row["quantity"]
    named = {
        "x": Variable("t", samples.x, unit, "displacement about the equilibrium"),
        "residual": Variable("t", samples.residual, unit, "measured minus model"),
    }
    times = {"t": Variable("t", samples.t, "s", "time from the first sample")}
    kept = ("key", "file", "run", "friction", "status", "sha256", "fricjax")
    buffer = io.BytesIO()
    facts = {name: str(row[name]) for name in kept}
    dataset(named, times, Conventions="CF-1.11", **facts).to_netcdf(buffer, engine="h5netcdf")
    return buffer.getvalue()
