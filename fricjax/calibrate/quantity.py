"""Calibrated numbers as people write them: ``9.66``, ``"410.7(3) g"``, ``{ value = 12.6, std = 0.01, unit = "Hz" }``.

A rig is either linear (kg, N/m, N) or rotary (kg m^2, N m/rad, N m). A quantity with a unit is converted to the SI unit
of whichever of the two it fits; a bare number is taken as SI.
"""

import re
from collections.abc import Mapping
from typing import Any

from ..data.errors import UsageError, nearest
from ..data.units import si_unit
from .measured import Measured

UNITS: Mapping[str, tuple[str, str]] = {
    "mass": ("kg", "kg m^2"),
    "stiffness": ("N/m", "N m/rad"),
    "frequency": ("Hz", "Hz"),
    "damping": ("N s/m", "N m s/rad"),
    "damping_ratio": ("", ""),
    "normal_force": ("N", "N m"),
    "k3": ("N/m^3", "N m/rad^3"),
    "drag": ("N s^2/m^2", "N m s^2/rad^2"),
    "displacement_scale": ("", ""),
    "time_scale": ("", ""),
    "periodic_nonlinearity": ("m", "rad"),
    "nonlinearity_period": ("m", "rad"),
}
_KEYS = ("value", "std", "unit")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_TEXT = re.compile(
    rf"\s*(?P<value>{_NUMBER})(?:\((?P<digits>\d+)\))?(?P<exponent>[eE][-+]?\d+)?"
    rf"(?:\s*(?:\+/-|±)\s*(?P<std>{_NUMBER}(?:[eE][-+]?\d+)?)\s*(?P<percent>%)?)?\s*(?P<unit>(?:1/)?[^\d\s].*?)?\s*"
)


def quantity(name: str, given: Any) -> Measured:
    """A calibrated input in SI units.

    Args:
        name: which input it is, a key of `UNITS`.
        given: a number (SI), a `Measured` (SI), a text such as ``"410.7(3) g"`` or ``"9.66 +/- 0.05 N"``, or a mapping
            with `value` and perhaps `std` (a number, or a text such as ``"0.5 %"``) and `unit`.

    Raises:
        UsageError: text that is no quantity, an unknown key or unit, or a unit that does not fit the input.
    """
    if isinstance(given, Measured):
        return given
    if isinstance(given, str):
        return _from_text(name, given)
    if isinstance(given, Mapping):
        return _from_mapping(name, given)
    try:
        return Measured(given)
    except UsageError as error:
        raise UsageError(f"{name} must be a finite number{_of(name)}, got {given!r}.") from error


def _of(name: str) -> str:
    return f" of {UNITS[name][0]}" if UNITS[name][0] else ""


def written(text: str) -> tuple[float, float, str] | None:
    """Value, standard uncertainty and unit of a text such as ``"410.7(3) g"``; None where it is no quantity."""
    match = _TEXT.fullmatch(text)
    if match is None or (match["digits"] and match["std"]):
        return None
    value = float(match["value"] + (match["exponent"] or ""))
    return value, _written_std(match, value), match["unit"] or ""


def _from_text(name: str, text: str) -> Measured:
    found = written(text)
    if found is None:
        raise UsageError(
            f'{name} = "{text}" is no quantity; write a number, its uncertainty and its unit, '
            f'such as "410.7(3) g" or "9.66 +/- 0.05 N".'
        )
    return _converted(name, *found)


def _written_std(match: re.Match[str], value: float) -> float:
    """Standard uncertainty as written: in brackets it counts the last digits of the value, with % it is relative."""
    if match["digits"]:
        decimals = len(match["value"].partition(".")[2])
        return float(f"{match['digits']}e{-decimals}") * float("1" + (match["exponent"] or ""))
    if match["std"] is None:
        return 0.0
    return float(match["std"]) * (abs(value) / 100 if match["percent"] else 1.0)


def _from_mapping(name: str, given: Mapping[str, Any]) -> Measured:
    for key in given:
        if key not in _KEYS:
            raise UsageError(f"{name} has no entry '{key}'; known are {', '.join(_KEYS)}.{nearest(key, _KEYS)}")
    if "value" not in given:
        raise UsageError(f"{name} = {dict(given)} lacks its value; write {name} = {{ value = ..., std = ... }}.")
    value = _number(name, "value", given["value"])
    return _converted(name, value, _std(name, given.get("std", 0.0), value), str(given.get("unit", "")))


def _number(name: str, key: str, given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise UsageError(f"The {key} of {name} must be a number, got {given!r}.")
    return float(given)


def _std(name: str, given: Any, value: float) -> float:
    relative = re.fullmatch(rf"\s*({_NUMBER})\s*%\s*", given) if isinstance(given, str) else None
    return float(relative[1]) / 100 * abs(value) if relative else _number(name, "std", given)


def _converted(name: str, value: float, std: float, unit: str) -> Measured:
    factor = 1.0 if unit in ("", *UNITS[name]) else _factor(name, unit)
    try:
        return Measured(value * factor, std * factor)
    except UsageError as error:
        raise UsageError(f"{name}: {error}") from error


def _factor(name: str, unit: str) -> float:
    """What one `unit` is in the SI unit of the input."""
    found = si_unit(unit)
    if found is None:
        raise UsageError(f"{name} has the unknown unit '{unit}'; use for example {_examples(name)}.")
    if name == "frequency" and found[1] == _dimension("rad/s"):
        raise UsageError(f"frequency counts cycles: give it in Hz, not in '{unit}' (1 Hz is 2 pi rad/s).")
    for target in UNITS[name]:
        # A radian is one: a stiffness in N m is one in N m/rad.
        if found[1] in (_dimension(target), _dimension(target.partition("/rad")[0])):
            return found[0]
    raise UsageError(f"The unit '{unit}' does not fit {name}; use for example {_examples(name)}.")


def _dimension(unit: str) -> str | None:
    found = si_unit(unit)
    return None if found is None else found[1]


def _examples(name: str) -> str:
    linear, rotary = UNITS[name]
    if not linear:
        return "'%'"
    return f"'{linear}'" if linear == rotary else f"'{linear}' (rotary rigs: '{rotary}')"
