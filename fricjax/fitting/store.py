"""Fits on disk: JSON with a schema version, readable without this package and never executed when read."""

import dataclasses
import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import friction as friction_laws
from ..data.errors import DataError
from ..friction import AbstractFriction
from ..oscillator import Exact, Hybrid, Oscillator, Smooth, restoring
from ..oscillator.engines import AbstractEngine, Span
from ..show.files import write_text
from .noise import Line, Noise
from .residual import Run
from .rest import Margin
from .settled import Estimate
from .whiteness import Whiteness

if TYPE_CHECKING:
    from .result import Fit

SCHEMA = "fricjax.fit/5"

_MODULES: dict[str, type] = {
    **{name: getattr(friction_laws, name) for name in friction_laws.__all__ if name != "AbstractFriction"},
    **{cls.__name__: cls for cls in (restoring.Linear, restoring.Cubic, restoring.Pendulum, restoring.Structural)},
    **{cls.__name__: cls for cls in (Oscillator, Exact, Hybrid, Smooth, Run)},
}
_TUPLES: dict[str, type] = {cls.__name__: cls for cls in (Estimate, Line, Margin, Noise, Span, Whiteness)}
_SAMPLES = ("residuals", "times", "runs", "origins", "engine_used")


def to_dict(fit: "Fit") -> dict[str, Any]:
    """The fit as plain data that JSON can hold, without the samples."""
    fields = {field.name: getattr(fit, field.name) for field in dataclasses.fields(fit) if field.name not in _SAMPLES}
    fields["kinematics"] = {name: estimate._asdict() for name, estimate in fit.kinematics.items()}
    return {"schema": SCHEMA, "chi2_reduced": _plain(fit.chi2_reduced), **_plain(fields)}


def _plain(value: Any) -> Any:
    if isinstance(value, eqx.Module):
        fields = {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
        return {"type": type(value).__name__, **fields}
    if type(value).__name__ in _TUPLES:
        return {"type": type(value).__name__, **{k: _plain(v) for k, v in value._asdict().items()}}
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if hasattr(value, "dtype"):
        return _plain(np.asarray(value).tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def save(fit: "Fit", path: str | os.PathLike[str]) -> Path:
    """Write the fit with its samples; the file appears whole or not at all."""
    target = Path(path)
    content = {**to_dict(fit), "samples": {name: _plain(getattr(fit, name)) for name in _SAMPLES}}
    write_text(target, json.dumps(content, allow_nan=False))
    return target


def load_fit(path: str | os.PathLike[str]) -> "Fit":
    """Read a fit that :meth:`Fit.save` wrote.

    Raises:
        DataError: no such file, or one that does not hold a fit of this schema.
    """
    from .result import Fit

    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DataError(f"There is no file {path}. Check the path.") from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path} is not a JSON file: {error}. Write fits with fit.save().") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        found = content.get("schema") if isinstance(content, dict) else type(content).__name__
        raise DataError(f"{path} holds no fit of schema {SCHEMA} but {found!r}. Write it again with fit.save().")
    merged = {**content, **content.get("samples", {})}
    missing = [field.name for field in dataclasses.fields(Fit) if field.name not in merged]
    if missing:
        raise DataError(f"{path} lacks {', '.join(missing)}: only files written by fit.save() can be loaded.")
    return Fit(**{field.name: _restore(field.name, merged[field.name]) for field in dataclasses.fields(Fit)})


def _restore(name: str, value: Any) -> Any:
    if name == "kinematics":
        return {key: Estimate(*(_scalar(entry[k]) for k in Estimate._fields)) for key, entry in value.items()}
    if name in ("covariance", "combined_covariance"):
        return np.asarray([[_scalar(v) for v in row] for row in value], float)
    if name in ("flags", "intervals"):
        return {key: tuple(_scalar(v) for v in entry) for key, entry in value.items()}
    if name == "residuals":
        joint = bool(value) and isinstance(value[0], list)
        return tuple(map(_array, value)) if joint else _array(value)
    if name == "times":
        return tuple(map(_array, value))
    restored = _object(value)
    return tuple(restored) if isinstance(restored, list) else restored


def _object(value: Any) -> Any:
    if isinstance(value, dict):
        fields = {k: _object(v) for k, v in value.items() if k != "type"}
        kind = value.get("type")
        if kind in _TUPLES:
            return _TUPLES[kind](**{k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()})
        if kind is not None and kind not in _MODULES:
            raise DataError(
                f"The fit holds a {kind}, which fricjax does not know: laws of your own cannot be loaded. Read the "
                "file as plain JSON."
            )
        return fields if kind is None else _module(_MODULES[kind], fields)
    return [_object(v) for v in value] if isinstance(value, list) else _scalar(value)


def _module(cls: type, fields: dict[str, Any]) -> Any:
    if cls is friction_laws.Sum:
        return friction_laws.Sum(tuple(fields["laws"]))
    if issubclass(cls, AbstractFriction):
        return _law(cls, fields)
    if cls is Run:
        fields = jax.tree.map(jnp.asarray, fields)
    if issubclass(cls, AbstractEngine):
        # As arrays its numbers are traced, as they were in the fit, and a second prediction compiles nothing.
        fields = jax.tree.map(lambda value: jnp.asarray(value) if isinstance(value, float) else value, fields)
    return cls(**fields)


def _law(cls: type[AbstractFriction], fields: dict[str, Any]) -> AbstractFriction:
    """A law with these coefficients, unchecked: a fit may end where its user would not be let begin."""
    law = object.__new__(cls)
    for field in dataclasses.fields(cls):
        value = fields[field.name]
        listed = tuple(value) if isinstance(value, list) else value
        known = listed if field.metadata.get("static") else jax.tree.map(lambda v: np.asarray(v, float), listed)
        object.__setattr__(law, field.name, known)
    return law


def _scalar(value: Any) -> Any:
    return float(value) if value in ("nan", "inf", "-inf") else value


def _array(values: list) -> np.ndarray:
    return np.asarray([_scalar(v) for v in values], float)
