"""The package's own record format.

A record is stored as arrays and two JSON texts, `meta` and `log`. `encode` and `decode` define these parts; the csv,
npz and HDF5 writers and readers store them.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError, UsageError, brief
from .observation import NAMES, observation_of
from .record import Record, Step

SCHEMA = 1
MARK = "fricjax_record"
TEXT_MARK = f"# {MARK}: "
COLUMNS = {"t": "Time", "x": "Displacement", "sigma": "Sigma", "mask": "Used"}


def encode(record: Record) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the arrays and JSON texts of a record.

    The arrays are `t`, `x`, `mask` and, if known, `sigma`; the texts are `meta` and `log`.
    """
    trace = record.trace
    arrays = {"t": np.asarray(trace.t), "x": np.asarray(trace.x), "mask": np.asarray(trace.mask)}
    if trace.sigma is not None:
        arrays["sigma"] = np.asarray(trace.sigma)
    log = [{"name": step.name, "parameters": step.parameters, "effect": step.effect} for step in record.log]
    try:
        texts = {"meta": json.dumps(record.meta, allow_nan=True), "log": json.dumps(log, allow_nan=True)}
    except TypeError as error:
        raise DataError(f"The meta data or the log of the record cannot be written as JSON: {error}.") from error
    return arrays, texts


def decode(arrays: dict[str, np.ndarray], texts: dict[str, str], source: str) -> Record:
    """Restore a record from the parts that `encode` returned."""
    for name in ("t", "x", "mask"):
        if name not in arrays:
            raise damaged(source, f"'{name}' is missing")
    for name, array in arrays.items():
        if name in COLUMNS and np.asarray(array).dtype.kind not in "fiub":
            raise damaged(source, f"'{name}' holds {np.asarray(array).dtype} instead of real numbers")
    mask = np.asarray(arrays["mask"])
    if not np.all((mask == 0) | (mask == 1)):
        raise damaged(source, "'mask' holds other values than 0 and 1")
    from .trace import Trace

    meta, steps = _meta(texts, source), _log(texts, source)
    try:
        return Record(Trace(arrays["t"], arrays["x"], arrays.get("sigma"), mask.astype(bool)), meta, steps)
    except DataError as error:
        raise damaged(source, str(error).rstrip(".")) from error


def restored(arrays: dict[str, np.ndarray], texts: dict[str, str], source: str) -> Record:
    """Restore a record from a file of any version.

    Raises:
        DataError: a later version wrote it, or a part is missing or invalid.
    """
    check_schema(texts[MARK], source)
    if "sigma" in arrays and arrays["sigma"].size == 1:
        arrays = {**arrays, "sigma": arrays["sigma"].reshape(())}
    return decode(arrays, texts, source)


def damaged(source: str, what: str) -> DataError:
    """Return the error for a record in the package's own format."""
    return DataError(f"{source} claims to be a fricjax record, but it is damaged: {what}.")


def _json(texts: dict[str, str], name: str, source: str) -> Any:
    try:
        return json.loads(texts.get(name, ""))
    except (ValueError, RecursionError) as error:
        words = "nested too deeply" if isinstance(error, RecursionError) else str(error)[:120]
        raise damaged(source, f"'{name}' is no JSON ({words})") from error


def _meta(texts: dict[str, str], source: str) -> dict[str, Any]:
    """Parse the metadata and check the entries that the package uses."""
    meta = _json(texts, "meta", source)
    if not isinstance(meta, dict):
        raise damaged(source, f"'meta' must be an object, but it is {brief(meta)}")
    try:
        observation_of(meta)
    except (DataError, UsageError, TypeError) as error:
        raise damaged(source, str(error)[:200].rstrip(".")) from error
    release = meta.get("release_time")
    if release is not None and not (isinstance(release, float | int) and abs(release) < 1e300):
        raise damaged(source, f"'release_time' must be a number of seconds, but it is {brief(release)}")
    return meta


def _log(texts: dict[str, str], source: str) -> tuple[Step, ...]:
    log = _json(texts, "log", source)
    kinds = {"name": str, "parameters": dict, "effect": str}
    for entry in log if isinstance(log, list) else [log]:
        if not isinstance(entry, dict) or not all(isinstance(entry.get(key), kind) for key, kind in kinds.items()):
            raise damaged(source, f"'log' must be a list of steps with {', '.join(kinds)}, but has {brief(entry)}")
    return tuple(Step(entry["name"], entry["parameters"], entry["effect"]) for entry in log)


def check_schema(version: Any, source: str) -> None:
    """Refuse a record that a later version of the package wrote."""
    text = str(version).strip()
    # isdigit() also accepts digits of other scripts, and int() refuses thousands of digits.
    if not (text.isascii() and text.isdigit() and len(text) < 5 and 1 <= int(text) <= SCHEMA):
        raise DataError(
            f"{source} is a fricjax record of schema {text[:20]}, but this version reads up to {SCHEMA}; update."
        )


def to_text(record: Record) -> str:
    """Return the record as a text table with metadata in comments.

    Any program can read the table; `restore_text` restores the full record.
    """
    arrays, texts = encode(record)
    head = {MARK: str(SCHEMA), "sigma": "null", **texts}
    names = ["t", "x", "mask"]
    if "sigma" in arrays and arrays["sigma"].ndim == 0:
        head["sigma"] = repr(float(arrays["sigma"]))
    elif "sigma" in arrays:
        names = ["t", "x", "sigma", "mask"]
    units = {"t": "s", "x": record.quantity, "sigma": record.quantity}
    observation = record.observation
    columns = COLUMNS | ({} if observation.kind == "displacement" else {"x": observation.name})
    titles = [f"{columns[name]} [{units[name]}]" if name in units else columns[name] for name in names]
    lines = [f"# {key}: {value}" for key, value in head.items()] + [",".join(titles)]
    shown = {**arrays, "x": np.where(~arrays["mask"] & (arrays["x"] == 0.0), np.nan, arrays["x"])}
    shown["mask"] = arrays["mask"].astype(int)
    rows = zip(*(shown[name].tolist() for name in names), strict=True)
    return "\n".join([*lines, *(",".join(map(repr, row)) for row in rows)]) + "\n"


def restore_text(path: Path, lines: list[str]) -> Record | None:
    """Restore the record that `to_text` wrote; return None for other text."""
    if not lines or not lines[0].startswith(TEXT_MARK):
        return None
    head = dict(line[2:].split(": ", 1) for line in lines[:8] if line.startswith("# ") and ": " in line)
    check_schema(head[MARK], path.name)
    start = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    titles = lines[start].split(",") if start < len(lines) else []
    by_title = {title: name for name, title in COLUMNS.items()} | dict.fromkeys(NAMES, "x")
    names = [by_title.get(title.split(" [")[0], title) for title in titles]
    try:
        table = np.array([[float(field) for field in line.split(",")] for line in lines[start + 1 :] if line.strip()])
        arrays = dict(zip(names, table.T, strict=True))
        if head.get("sigma", "null") != "null":
            arrays["sigma"] = np.asarray(float(head["sigma"]))
    except ValueError as error:
        raise DataError(
            f"{path.name} claims to be a fricjax record, but its table is damaged: {str(error)[:120]}."
        ) from error
    return decode(arrays, head, path.name)
