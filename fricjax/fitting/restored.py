"""Restore a fit from JSON data, checked against the type annotations.

The annotations of the classes define the valid content: a number, a list of the declared length, or an object with
exactly the fields of its class. An error message names the field with any other content.
"""

import dataclasses
import functools
import math
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Union, get_args, get_origin

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import friction as friction_laws
from ..data.observation import Observation
from ..errors import DataError, UsageError, brief, nearest
from ..friction import AbstractFriction
from ..oscillator import Exact, Hybrid, Oscillator, Smooth, restoring
from ..oscillator.engines import AbstractEngine
from ..oscillator.engines.hybrid import Span
from ..rig import Measured
from .noise import Line, Noise, Whiteness
from .residual import Run
from .rest import Margin

MODULES: Mapping[str, type] = {
    **{name: getattr(friction_laws, name) for name in friction_laws.__all__ if name != "AbstractFriction"},
    **{cls.__name__: cls for cls in (restoring.Linear, restoring.Cubic, restoring.Pendulum, restoring.Structural)},
    **{cls.__name__: cls for cls in (Oscillator, Exact, Hybrid, Smooth)},
}
RECORDS: Mapping[str, type] = {
    cls.__name__: cls for cls in (Line, Margin, Measured, Noise, Observation, Run, Span, Whiteness)
}
_WORDS = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", types.NoneType: "null"}
# Larger integers cannot be counts, and floating-point numbers cannot represent them all.
_LARGEST_COUNT = 1 << 53
# No fit contains larger numbers, and their squares are still finite. Values that are not finite are stored as text.
_LARGEST = 1e150


def restored(kind: Any, value: Any, place: str) -> Any:
    """Return the value of a field declared as `kind`.

    Args:
        kind: the annotation of the field.
        value: content of the file for it.
        place: path of the field for messages, such as "runs[0].fixed".

    Raises:
        DataError: the value does not match the annotation.
    """
    if get_origin(kind) in (Union, types.UnionType):
        return _one_of(get_args(kind), value, place)
    if get_origin(kind) is tuple:
        return _listed(get_args(kind), value, place)
    if get_origin(kind) is dict:
        entries = _expect(isinstance(value, dict), value, place, "an object")
        return {name: restored(get_args(kind)[1], entry, f"{place}.{name}") for name, entry in entries.items()}
    if kind in _WORDS:
        return _plain(kind, value, place)
    if kind is np.ndarray:
        return _array(_expect(isinstance(value, list), value, place, "a list of numbers"), place)
    if isinstance(kind, type) and issubclass(kind, eqx.Module):
        return _module(kind, value, place)
    if isinstance(kind, type) and kind in RECORDS.values():
        fields = _fields(kind, typing.get_type_hints(kind), value, place)
        try:
            return _built(kind)(**fields)
        except UsageError as error:
            raise DataError(f"'{place[:200]}' is no {kind.__name__} ({str(error).rstrip('.')})") from error
    # Other annotations are those of traced numbers, without a shape: one number or an array.
    return _array(value, place) if isinstance(value, list) else _number(value, place)


def _expect(fits: bool, value: Any, place: str, what: str) -> Any:
    if not fits:
        raise DataError(f"'{place[:200]}' must be {what}, but it is {brief(value)}")
    return value


def _one_of(kinds: tuple[Any, ...], value: Any, place: str) -> Any:
    """Return the value as the first matching kind, or raise an error."""
    if value is None and types.NoneType in kinds:
        return None
    refusals = []
    for kind in kinds:
        try:
            return restored(kind, value, place)
        except DataError as error:
            refusals.append(error)
    raise refusals[0]


def _listed(kinds: tuple[Any, ...], value: Any, place: str) -> tuple[Any, ...]:
    length = None if kinds[-1] is Ellipsis else len(kinds)
    what = "a list" if length is None else f"a list of {length}"
    entries = _expect(isinstance(value, list) and length in (None, len(value)), value, place, what)
    declared = kinds[:1] * len(entries) if length is None else kinds
    return tuple(
        restored(kind, entry, f"{place}[{i}]") for i, (kind, entry) in enumerate(zip(declared, entries, strict=True))
    )


def _plain(kind: type, value: Any, place: str) -> Any:
    if kind is float:
        return float(_number(value, place))
    fits = isinstance(value, kind) and not (kind is int and (isinstance(value, bool) or abs(value) > _LARGEST_COUNT))
    return _expect(fits, value, place, _WORDS[kind])


def _number(value: Any, place: str) -> float | int:
    """Return a number; those that are not finite are stored as text."""
    if value in ("nan", "inf", "-inf"):
        return float(value)
    counted = isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _LARGEST_COUNT
    real = isinstance(value, float) and not _LARGEST < abs(value) < math.inf
    return _expect(counted or real, value, place, "a number")


def _array(value: Any, place: str) -> np.ndarray:
    """Return rows of equal length as a float64 array."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        rows = [_array(_expect(isinstance(row, list), row, place, "a list of rows"), place) for row in value]
        _expect(len({row.shape for row in rows}) == 1, value, place, "a list of rows of one length")
        return np.stack(rows)
    return np.asarray([_number(entry, place) for entry in value], float)


def _module(base: type, value: Any, place: str) -> Any:
    """Restore a law, an oscillator or an engine by its class name."""
    _expect(isinstance(value, dict), value, place, f"an object of the type {base.__name__.removeprefix('Abstract')}")
    name = value.get("type")
    cls = MODULES.get(name) if isinstance(name, str) else None
    if cls is None:
        raise DataError(
            f"The fit holds a {str(name)[:80]}, which fricjax does not know: custom laws cannot be loaded. Read the "
            "file as plain JSON"
        )
    _expect(issubclass(cls, base), name, f"{place}.type", f"a {base.__name__.removeprefix('Abstract')}")
    declared = {field.name: _annotations(cls)[field.name] for field in dataclasses.fields(cls)}
    fields = _fields(cls, declared, value, place)
    try:
        return _built(cls)(**fields)
    except (ValueError, TypeError) as error:
        raise DataError(f"'{place[:200]}' is no {cls.__name__} ({str(error).rstrip('.')})") from error


@functools.cache
def _annotations(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _fields(cls: type, declared: Mapping[str, Any], value: Any, place: str) -> dict[str, Any]:
    """Restore the fields of an object, exactly those of its class."""
    _expect(isinstance(value, dict), value, place, f"an object of the type {cls.__name__}")
    for name in value:
        if name not in declared and name != "type":
            raise DataError(
                f"'{place[:200]}' has an entry {brief(name)} that no {cls.__name__} has.{nearest(name, declared)}"
            )
    for name in declared:
        if name not in value:
            raise DataError(f"'{place[:200]}' has no entry '{name}'")
    return {name: restored(kind, value[name], f"{place}.{name}") for name, kind in declared.items()}


def _built(cls: type) -> Callable[..., Any]:
    """Return the function that builds an object from its fields."""
    if cls is friction_laws.Sum:
        return lambda laws: cls(laws)
    if not issubclass(cls, AbstractFriction | AbstractEngine | Run):
        return cls
    if issubclass(cls, AbstractFriction):
        return functools.partial(_law, cls)
    # Numbers of a run and of an engine are arrays, hence traced as in the fit, so a second prediction does not compile.
    # Counts of an engine are static.
    kinds = float | int | np.ndarray if cls is Run else float
    return lambda **fields: cls(
        **jax.tree.map(lambda leaf: jnp.asarray(leaf) if isinstance(leaf, kinds) else leaf, fields)
    )


def _law(cls: type[AbstractFriction], **fields: Any) -> AbstractFriction:
    """Build a law without checks, which fitted values may violate."""
    law = object.__new__(cls)
    for field in dataclasses.fields(cls):
        value = fields[field.name]
        known = value if field.metadata.get("static") else jax.tree.map(lambda leaf: np.asarray(leaf, float), value)
        object.__setattr__(law, field.name, known)
    return law
