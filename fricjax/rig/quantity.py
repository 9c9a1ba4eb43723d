"""Calibrated numbers as people write them: ``9.66``, ``"410.7(3) g"``, ``{ value = 12.6, std = 0.01, unit = "Hz" }``.

A rig is either linear (kg, N/m, N) or rotary (kg m^2, N m/rad, N m). A quantity with a unit is converted to the SI unit
of whichever of the two it fits; a bare number is taken as SI.
"""

import re
from collections.abc import Mapping
from typing import Any

from ..data.units import LONGEST as LONGEST_UNIT
from ..data.units import Unit, unit_of
from ..errors import UsageError, brief, nearest
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
_LONGEST = 3 * LONGEST_UNIT
"""Characters of the longest text that can be a quantity: two numbers and a unit."""
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
        raise UsageError(f"{name} must be a finite number{_of(name)}, got {brief(given)}.") from error


def _of(name: str) -> str:
    return f" of {UNITS[name][0]}" if UNITS[name][0] else ""


def written(text: str) -> tuple[float, float, str] | None:
    """Value, standard uncertainty and unit of a text such as ``"410.7(3) g"``; None where it is no quantity."""
    match = _TEXT.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None or (match["digits"] and match["std"]):
        return None
    value = float(match["value"] + (match["exponent"] or ""))
    return value, _written_std(match, value), match["unit"] or ""


def _from_text(name: str, text: str) -> Measured:
    found = written(text)
    if found is None:
        raise UsageError(
            f'{name} = "{text[:_LONGEST]}" is no quantity; write a number, its uncertainty and its unit, '
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
            raise UsageError(f"{name} has no entry {brief(key)}; known are {', '.join(_KEYS)}.{nearest(key, _KEYS)}")
    if "value" not in given:
        raise UsageError(f"{name} = {brief(dict(given))} lacks its value; write {name} = {{ value = ..., std = ... }}.")
    value, unit = _number(name, "value", given["value"]), given.get("unit", "")
    if not isinstance(unit, str):
        raise UsageError(f"The unit of {name} must be a text such as {_examples(name)}, got {brief(unit)}.")
    return _converted(name, value, _std(name, given.get("std", 0.0), value), unit.strip())


def _number(name: str, key: str, given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise UsageError(f"The {key} of {name} must be a number, got {brief(given)}.")
    try:
        return float(given)
    except OverflowError as error:
        raise UsageError(f"The {key} of {name} must be finite, got {brief(given)}.") from error


def _std(name: str, given: Any, value: float) -> float:
    short = isinstance(given, str) and len(given) <= _LONGEST
    relative = re.fullmatch(rf"\s*({_NUMBER})\s*%\s*", given) if short else None
    return float(relative[1]) / 100 * abs(value) if relative else _number(name, "std", given)


def _converted(name: str, value: float, std: float, unit: str) -> Measured:
    factor = 1.0 if unit in ("", *UNITS[name]) else _factor(name, unit)
    try:
        return Measured(value * factor, std * factor)
    except UsageError as error:
        raise UsageError(f"{name}: {error}") from error


def _factor(name: str, unit: str) -> float:
    """What one `unit` is in the SI unit of the input."""
    found = unit_of(unit)
    if found is None:
        raise UsageError(f"{name} has the unknown unit {brief(unit)}; use for example {_examples(name)}.")
    if name == "frequency" and "rad" in found.powers:
        raise UsageError(f"frequency counts cycles: give it in Hz, not in '{unit}' (1 Hz is 2 pi rad/s).")
    if not any(_dimension(found) == _dimension(unit_of(goal) or Unit(1.0, {})) for goal in UNITS[name]):
        raise UsageError(f"The unit '{unit}' does not fit {name}; use for example {_examples(name)}.")
    return found.scale


def _dimension(unit: Unit) -> dict[str, int]:
    """Powers of the SI units, without the radian, which may be left out: a stiffness is given in N m as in N m/rad."""
    return {name: power for name, power in unit.powers.items() if name != "rad"}


def _examples(name: str) -> str:
    linear, rotary = UNITS[name]
    if not linear:
        return "'%'"
    return f"'{linear}'" if linear == rotary else f"'{linear}' (rotary rigs: '{rotary}')"
