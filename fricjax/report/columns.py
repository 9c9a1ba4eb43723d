"""Compact columns of a table of runs, with units and formatted numbers."""

import base64
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..archive.show import unit_of
from ..fitting.derived import UNITS
from ..fitting.names import of_run
from ..show import display_unit, uncertain

if TYPE_CHECKING:
    from pandas import DataFrame

STD, COMBINED = "_std", "_combined_std"
_TIMES = ("measured_at", "modified", "finished_at")
_JUDGEMENT = ("chi2_reduced", "residual_rms", "sigma", "numerical_shift", "half_cycles", "iterations", "passes")
_RECORD = ("quantity", "samples", "rate", "duration", "amplitude", "load", "rig")
_PROVENANCE = ("key", "engine", "sha256", "bytes", "inode", "settings", "seconds_read", "seconds_fit")
_PROVENANCE += ("fricjax", "jax", "python", "host", "worker")
# Columns that the page shows in other places, or not at all.
_APART = ("file", "run", "friction", "status", "outcome", "warnings", "noise")
_CURVES = ("sketch_t", "sketch_x", "sketch_residual", "reversal_t", "reversal_x")


def packed(values: Any, kind: str) -> str:
    """Encode numbers as base64 of their bytes.

    Args:
        values: the numbers.
        kind: data type in NumPy's notation, such as "<f8" (little-endian).
    """
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def numbers(frame: "DataFrame", name: str) -> np.ndarray:
    """Return a column as float64, with NaN for missing numbers."""
    return np.asarray(frame[name].to_numpy(float, na_value=np.nan)) if name in frame else np.full(len(frame), np.nan)


def parameters(frame: "DataFrame") -> list[str]:
    """List the columns that have a column of standard errors."""
    return [name for name in map(str, frame.columns) if f"{name}{STD}" in frame.columns]


def columns(frame: "DataFrame", quantity: str) -> list[dict[str, Any]]:
    """Convert the columns of a table, without curves, to data for JSON.

    Each column has a `name`, a `label`, the `unit` of its numbers, a `group` ("run", "parameter", "kinematics",
    "record", "judgement", "fact" or "provenance"), and `shown`, which is true if the table shows it at first. A column
    of numbers has `values`, packed float64. A column of parameters also has `std`, and `text`, the numbers with their
    uncertainties. A column of texts has its distinct `words`, and `at`, the index of the word of each row.
    """
    laws = sorted(set(frame["friction"].dropna())) if "friction" in frame else []
    names = parameters(frame)
    apart = {*_CURVES, *(f"{name}{end}" for name in names for end in (STD, COMBINED))}
    made = []
    for name in map(str, frame.columns):
        if name in apart:
            continue
        unit = unit_of(name, laws, quantity)
        if name in names:
            made.append(_parameter(frame, name, unit))
        else:
            made.append(_column(frame, name, unit))
        made[-1]["group"] = _group(name, names)
        made[-1]["shown"] = _shown(frame, name, names)
    return made


def _group(name: str, names: Sequence[str]) -> str:
    if name in names:
        return "kinematics" if name in UNITS else "parameter"
    groups: Mapping[str, Sequence[str]] = {
        "run": _APART,
        "judgement": _JUDGEMENT,
        "record": (*_RECORD, "measured_at"),
        "provenance": (*_PROVENANCE, *_TIMES),
    }
    return next((group for group, members in groups.items() if name in members), "fact")


def _shown(frame: "DataFrame", name: str, names: Sequence[str]) -> bool:
    """Return True if the table shows a column by default.

    These are parameters, facts, and columns that distinguish runs.
    """
    group = _group(name, names)
    if group == "parameter":
        return not of_run(name)
    if name in ("load", "friction", "rig"):
        return len(set(frame[name].dropna())) > 1
    return group == "fact" or name in ("outcome", "amplitude", "half_cycles", "chi2_reduced", "measured_at")


def _column(frame: "DataFrame", name: str, unit: str) -> dict[str, Any]:
    """Convert a column of times, numbers or texts."""
    import pandas as pd

    series: Any = frame[name]
    label = name.replace("_", " ")
    if name in _TIMES:
        instants = pd.to_datetime(series, utc=True, errors="coerce", format="ISO8601").dt.tz_localize(None)
        since = instants.to_numpy("datetime64[ms]")
        ms = np.where(np.isnat(since), np.nan, since.astype(np.int64))
        return {"name": name, "label": label, "kind": "time", "values": packed(ms, "<f8")}
    if pd.api.types.is_numeric_dtype(series) and not pd.api.types.is_bool_dtype(series):
        values = numbers(frame, name)
        factor, shown = typical_unit(values, unit)
        column: dict[str, Any] = {"name": name, "label": label, "unit": shown, "kind": "number"}
        if name == "half_cycles":
            # The number is unknown if the record ends in motion.
            column["text"] = ["" if n != n else "in motion" if n < 0 else f"{n:.0f}" for n in values]
        return column | {"values": packed(factor * values, "<f8")}
    # File names can contain bytes that are not text. The strings of pandas refuse them, a dictionary does not.
    texts = ["" if missing else str(each) for each, missing in zip(series, series.isna(), strict=True)]
    place = {word: i for i, word in enumerate(dict.fromkeys(texts))}
    return {
        "name": name,
        "label": label,
        "kind": "text",
        "words": list(place),
        "at": packed([place[text] for text in texts], "<u4"),
    }


def _parameter(frame: "DataFrame", name: str, unit: str) -> dict[str, Any]:
    """Convert a column of values with uncertainties.

    The text contains the combined uncertainty, the drawing uses the statistical one.
    """
    value, std = numbers(frame, name), numbers(frame, f"{name}{STD}")
    combined = numbers(frame, f"{name}{COMBINED if f'{name}{COMBINED}' in frame else STD}")
    factor, shown = typical_unit(value, unit)
    pairs = zip((factor * value).tolist(), (factor * np.abs(combined)).tolist(), strict=True)
    return {
        "name": name,
        "label": name.replace("_", " "),
        "unit": shown,
        "kind": "number",
        "values": packed(factor * value, "<f8"),
        "std": packed(factor * std, "<f8"),
        "text": ["" if math.isnan(value) else uncertain(value, std) for value, std in pairs],
    }


def typical_unit(values: np.ndarray, unit: str) -> tuple[float, str]:
    """Choose the SI prefix for a typical value; return factor and unit."""
    size = np.abs(values[np.isfinite(values) & (values != 0)])
    return display_unit(float(np.median(size)), unit) if size.size else (1.0, unit)
