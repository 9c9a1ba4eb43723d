"""Store fits as JSON with a schema version, readable without this package.

Reading a file never executes code.
"""

import dataclasses
import json
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, get_type_hints

import equinox as eqx
import numpy as np

from ..data.files import content as read_content
from ..errors import DataError, brief, path_of
from ..oscillator.engines import AbstractEngine
from ..show.files import write_text
from .restored import RECORDS, restored

SCHEMA = "fricjax.fit/8"

_LARGEST = 1_000_000_000
"""Bytes of the largest readable file; a million samples take about 100 MB."""
_SAMPLES = ("residuals", "times", "runs", "origins", "engine_used")
_KINDS = {"residuals": tuple[np.ndarray, ...] | np.ndarray, "engine_used": AbstractEngine}
"""Types of the fields that are annotated as Any."""


def to_dict(fit: Any) -> dict[str, Any]:
    """Convert a fit to plain data for JSON, without the samples."""
    names = [name for name in _saved(fit) if name not in _SAMPLES]
    fields = {name: getattr(fit, name) for name in names}
    fields["kinematics"] = {name: estimate._asdict() for name, estimate in fit.kinematics.items()}
    facts = {"chi2_reduced": plain_fields(fit.chi2_reduced), "described": fit.described}
    return {"schema": SCHEMA, **facts, **plain_fields(fields)}


def _saved(fit: Any) -> list[str]:
    """Return the names of the saved fields: all except the problem."""
    return [field.name for field in dataclasses.fields(fit) if field.name != "problem"]


def plain_fields(value: Any) -> Any:
    """Convert a result to plain data for JSON, with class names."""
    if isinstance(value, eqx.Module):
        fields = {field.name: plain_fields(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"type": type(value).__name__, **fields}
    if type(value).__name__ in RECORDS:
        names = getattr(value, "_fields", None) or [field.name for field in dataclasses.fields(value)]
        return {"type": type(value).__name__, **{name: plain_fields(getattr(value, name)) for name in names}}
    if isinstance(value, dict):
        return {str(k): plain_fields(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [plain_fields(v) for v in value]
    if hasattr(value, "dtype"):
        return plain_fields(np.asarray(value).tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def save(fit: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write the fit with its samples; replace the file as a whole."""
    content = {**to_dict(fit), "samples": {name: plain_fields(getattr(fit, name)) for name in _SAMPLES}}
    return write_text(path, json.dumps(content, allow_nan=False), overwrite=overwrite)


def read_fit[F](path: str | os.PathLike[str], cls: type[F]) -> F:
    """Read a fit of the class `cls` written by :func:`save`.

    Raises:
        DataError: no such file, or no fit of this schema; the message names the field.
    """
    source = path_of(path)
    stored = _stored(source, _saved(cls))
    kinds = {**get_type_hints(cls), **_KINDS}
    try:
        fit = cls(**{name: restored(kinds[name], stored[name], name) for name in stored})
        _check(fit)
    except DataError as error:
        raise DataError(f"{source}: {str(error).rstrip('.')}. Write fits with fit.save().") from error
    return fit


def _stored(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """Return the content of the file for each field of a fit."""
    try:
        content = json.loads(read_content(path, _LARGEST))
    except FileNotFoundError as error:
        raise DataError(f"There is no file {path}. Check the path.") from error
    except OSError as error:
        raise DataError(f"The file {path} cannot be read: {error.strerror}.") from error
    except RecursionError as error:
        raise DataError(
            f"{path} holds no fit: its objects are nested too deeply. Write fits with fit.save()."
        ) from error
    except DataError:
        raise
    except ValueError as error:  # invalid JSON, another encoding, or a number with thousands of digits
        raise DataError(f"{path} is not a JSON file: {str(error)[:200]}. Write fits with fit.save().") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        schema = content.get("schema") if isinstance(content, dict) else type(content).__name__
        raise DataError(f"{path} holds no fit of schema {SCHEMA} but {brief(schema)}. Write it again with fit.save().")
    samples = content.get("samples", {})
    merged = {**content, **(samples if isinstance(samples, dict) else {})}
    missing = [name for name in names if name not in merged]
    if missing:
        raise DataError(f"{path} does not hold {', '.join(missing)}: only files written by fit.save() can be loaded.")
    return {name: merged[name] for name in names}


def _check(fit: Any) -> None:
    """Raise an error if the fields are inconsistent."""
    errors = ("std_errors", "white_std_errors", "combined_std_errors")
    named: dict[str, Iterable[str]] = dict.fromkeys(errors, fit.names)
    named |= {"contributions": fit.names, "values": fit.names, "units": fit.values, "flags": fit.values}
    named |= {"intervals": [name for name in fit.values if name not in fit.std_errors]}
    for field, names in named.items():
        absent = [name for name in names if name not in getattr(fit, field)]
        if absent:
            raise DataError(f"'{field}' has no entry {brief(absent[0])}")
    stds = [(name, std) for field in errors for name, std in getattr(fit, field).items()]
    for name, std in [*stds, *((name, estimate.std) for name, estimate in fit.kinematics.items())]:
        if std < 0:
            raise DataError(f"the standard error of {brief(name)} is negative: {std:g}")
    p, n = len(fit.names), len(fit.runs)
    for field in ("covariance", "combined_covariance"):
        if getattr(fit, field).shape != (p, p):
            raise DataError(f"'{field}' has shape {getattr(fit, field).shape} for {p} parameters")
    for name, _ in stds:
        if name not in fit.names:
            raise DataError(f"there is a standard error of {brief(name)}, which is not among the names")
    residuals = fit.residuals_by_run
    listed = {"residuals": residuals} | {
        name: getattr(fit, name) for name in ("times", "origins", "noises", "margins", "half_cycles", "sources")
    }
    for field, entries in listed.items():
        if len(entries) != n or n == 0:
            raise DataError(f"'{field}' has {len(entries)} entries for {n} runs")
    for i, (run, times, left) in enumerate(zip(fit.runs, fit.times, residuals, strict=True)):
        shapes = {np.shape(each) for each in (run.t, run.x, run.weight, times, left)}
        if len(shapes) > 1 or len(next(iter(shapes))) != 1:
            raise DataError(f"times, displacements, weights and residuals of run {i} differ in number")
    unit = fit.observation.unit
    if fit.dof < 1 or fit.quantity != unit:
        raise DataError(
            f"'dof' must be positive and 'quantity' {unit}, but they are {fit.dof} and {fit.quantity[:80]!r}"
        )
