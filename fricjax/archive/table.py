"""Table of an archive: columns, rows, and merging of parts.

There is one row for each run and law. The parameter columns depend on the law; missing values are null. The residuals
of a run are a separate file with the identity of the run in its attributes.
"""

import io
import json
import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import needed
from ..show.tables import Variable, dataset
from .study import SCHEMA, facts_in

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
PICTURES = ["sketch_t", "sketch_x", "sketch_residual", "reversal_t", "reversal_x"]
_LAST = {
    **dict.fromkeys(PICTURES, "list"),
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


def of_rows(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Convert rows to an Arrow table; parameter columns keep their order."""
    pa = needed("An archive", "pyarrow", "batch")
    named = dict.fromkeys(name for row in rows for name in row)
    parameters = {name: "float64" for name in named if name not in COLUMNS}
    types = {"string": pa.string(), "int64": pa.int64(), "float64": pa.float64(), "list": pa.list_(pa.float32())}
    kinds = {**_BEFORE, **parameters, **_AFTER, **_LAST}
    return pa.table({name: pa.array([row.get(name) for row in rows], types[kind]) for name, kind in kinds.items()})


def joined(tables: Sequence[tuple[str, Any]], facts: Sequence[str], root: Path | None = None) -> Any:
    """Merge named parts, oldest first, into one table sorted by file.

    The newest rows of each file and law remain, and `facts` are the templates of further columns. If a file is missing
    in the folder `root` and its bytes exist under another path, it was moved, and its records are dropped.
    """
    pa = needed("An archive", "pyarrow", "batch")
    origin = [number for number, (_, table) in enumerate(tables) for _ in range(table.num_rows)]
    bare = [without_facts(table).replace_schema_metadata() for _, table in tables]
    table = pa.concat_tables(bare, promote_options="default")
    places, laws, keys = (table.column(name).to_pylist() for name in ("file", "friction", "key"))
    newest = {(file, law): number for file, law, number in zip(places, laws, origin, strict=True)}
    kept = [i for i, number in enumerate(origin) if newest[places[i], laws[i]] == number]
    copies = Counter(keys[i] for i in kept)
    if root is not None:
        kept = [i for i in kept if copies[keys[i]] == 1 or os.path.lexists(root / places[i])]
    kept.sort(key=lambda i: (places[i], laws[i]))
    parameters = [name for name in table.column_names if name not in COLUMNS]
    columns = _fact_columns([facts_in(facts, places[i]) for i in kept])
    # A fact does not replace a column of the table, such as the load.
    added = [name for name in columns if name not in table.column_names]
    table = table.take(pa.array(kept, pa.int64()))
    for name in added:
        table = table.append_column(name, pa.array(columns[name]))
    table = table.select([*_BEFORE, *parameters, *_AFTER, *added, *_LAST])
    parts = [name for part, each in tables for name in (note(each, "parts") or [part])]
    notes = {"schema": SCHEMA, "parts": parts, "facts": added, "templates": list(facts)}
    return table.replace_schema_metadata({f"fricjax.{name}": json.dumps(value) for name, value in notes.items()})


def note(table: Any, name: str) -> list[str]:
    """Return the "parts", "facts" or "templates" of a merged table."""
    return json.loads((table.schema.metadata or {}).get(f"fricjax.{name}".encode(), b"[]"))


def without_facts(table: Any) -> Any:
    """Return a table without its fact columns."""
    return table.drop_columns([name for name in note(table, "facts") if name in table.column_names])


def _fact_columns(facts: Sequence[Mapping[str, str]]) -> dict[str, list[Any]]:
    """Return a column for each fact, numeric if all values are numbers."""
    columns: dict[str, list[Any]] = {}
    for name in dict.fromkeys(name for row in facts for name in row):
        texts = [row.get(name) for row in facts]
        try:
            numbers = [math.nan if text is None else float(text) for text in texts]
        except ValueError:
            numbers = []
        finite = all(text is None or math.isfinite(number) for text, number in zip(texts, numbers, strict=False))
        columns[name] = [None if math.isnan(n) else n for n in numbers] if numbers and finite else texts
    return columns


def netcdf(row: Mapping[str, Any], samples: Any) -> bytes:
    """Return times, displacements and residuals of a run as netCDF-4."""
    needed("A file of residuals", "h5netcdf", "batch")
    unit = row["quantity"]
    named = {
        "x": Variable("t", samples.x, unit, "displacement about the equilibrium"),
        "residual": Variable("t", samples.residual, unit, "measured minus model"),
    }
    times = {"t": Variable("t", samples.t, "s", "time from the first sample")}
    facts = {name: str(row[name]) for name in ("key", "file", "run", "friction", "status", "sha256", "fricjax")}
    buffer = io.BytesIO()
    dataset(named, times, Conventions="CF-1.11", **facts).to_netcdf(buffer, engine="h5netcdf")
    return buffer.getvalue()
