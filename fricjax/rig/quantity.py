"""Conversion of calibrated numbers to SI units.

Accepted forms are ``9.66``, ``"410.7(3) g"`` and ``{ value = 12.6, std = 0.01, unit = "Hz" }``. A rig is either linear
(kg, N/m, N) or rotary (kg m^2, N m/rad, N m). A quantity with a unit is converted to the SI unit of the kind of rig
that it fits. A number without a unit is in SI units.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

from ..data.units import Unit, unit_of
from ..errors import UsageError, brief, nearest
from ..show.numbers import LONGEST, NUMBER, parse_uncertain
from ..show.units import rotary_unit
from .measured import Measured

# Units of a linear rig; `rotary_unit` gives those of a rotary rig.
UNITS: Mapping[str, str] = {
    "mass": "kg",
    "stiffness": "N/m",
    "frequency": "Hz",
    "damping": "N s/m",
    "damping_ratio": "",
    "normal_force": "N",
    "k3": "N/m^3",
    "drag": "N s^2/m^2",
    "displacement_scale": "",
    "time_scale": "",
    "periodic_nonlinearity": "m",
    "nonlinearity_period": "m",
}
_KEYS = ("value", "std", "unit")


def quantity(name: str, value: Any) -> Measured:
    """Convert a calibrated input to SI units.

    Args:
        name: name of the input, a key of `UNITS`.
        value: a number (SI), a `Measured` (SI if it has no unit), a text such as ``"410.7(3) g"`` or
            ``"9.66 +/- 0.05 N"``, or a mapping with `value` and optionally `std` (a number, or a text such as
            ``"0.5 %"``) and `unit`.

    Raises:
        UsageError: the text is not a quantity, a key or the unit is unknown, or the unit does not fit the input.
    """
    if isinstance(value, Measured):
        return _in_si(name, value.value, value.std, value.unit or "")
    if isinstance(value, Mapping):
        return _from_mapping(name, value)
    if isinstance(value, str):
        read = parse_uncertain(value)
        if read is None:
            raise UsageError(
                f'{name} = "{value[:LONGEST]}" is no quantity; write a number, its uncertainty and its unit, '
                f'such as "410.7(3) g" or "9.66 +/- 0.05 N".'
            )
        return _in_si(name, *read)
    try:
        number = Measured(value)
    except UsageError as error:
        raise UsageError(_not_finite(name, value)) from error
    return _in_si(name, number.value, number.std, "")


def _from_mapping(name: str, entries: Mapping[str, Any]) -> Measured:
    for key in entries:
        if key not in _KEYS:
            raise UsageError(f"{name} has no entry {brief(key)}; known are {', '.join(_KEYS)}.{nearest(key, _KEYS)}")
    if "value" not in entries:
        raise UsageError(f"{name} = {brief(dict(entries))} has no value; write {name} = {{ value = ..., std = ... }}.")
    value, std, unit = _number(name, "value", entries["value"]), entries.get("std", 0.0), entries.get("unit", "")
    if not isinstance(unit, str):
        raise UsageError(f"The unit of {name} must be a text such as {_examples(name)}, got {brief(unit)}.")
    # As in texts, an uncertainty in percent is relative to the value.
    short = isinstance(std, str) and len(std) <= LONGEST
    relative = re.fullmatch(rf"\s*({NUMBER})\s*%\s*", std) if short else None
    std = float(relative[1]) / 100 * abs(value) if relative else _number(name, "std", std)
    return _in_si(name, value, std, unit.strip())


def _number(name: str, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"The {key} of {name} must be a number, got {brief(value)}.")
    try:
        return float(value)
    except OverflowError as error:  # integers of TOML can have any length
        raise UsageError(f"The {key} of {name} must be finite, got {brief(value)}.") from error


def _in_si(name: str, value: Any, std: float, unit: str) -> Measured:
    known = (UNITS[name], rotary_unit(UNITS[name], "rad"))
    factor = 1.0
    if unit not in ("", *known):
        read = unit_of(unit)
        if read is None:
            comma = " A decimal sign is a point here." if unit.startswith(",") else ""
            raise UsageError(f"{name} has the unknown unit {brief(unit)}; use for example {_examples(name)}.{comma}")
        # Hz and rad/s have the same dimension; a factor of 2 pi between them would remain unnoticed.
        if name == "frequency" and "rad" in read.powers:
            raise UsageError(f"frequency counts cycles: give it in Hz, not in '{unit}' (1 Hz is 2 pi rad/s).")
        if not any(_dimension(read) == _dimension(unit_of(si) or Unit(1.0, {})) for si in known):
            raise UsageError(f"The unit '{unit}' does not fit {name}; use for example {_examples(name)}.")
        factor = read.scale
    try:
        number = Measured(value * factor, std * factor)
    except UsageError as error:
        raise UsageError(f"{name}: {error}") from error
    if not number.is_finite:
        raise UsageError(_not_finite(name, value if math.isfinite(std) else number))
    return number


def _not_finite(name: str, value: Any) -> str:
    return f"{name} must be a finite number{f' of {UNITS[name]}' if UNITS[name] else ''}, got {brief(value)}."


def _dimension(unit: Unit) -> dict[str, int]:
    """Powers of the SI units without the radian.

    The radian is optional: a stiffness is given in N m or in N m/rad.
    """
    return {name: power for name, power in unit.powers.items() if name != "rad"}


def _examples(name: str) -> str:
    linear, rotary = UNITS[name], rotary_unit(UNITS[name], "rad")
    if not linear:
        return "'%'"
    return f"'{linear}'" if linear == rotary else f"'{linear}' (rotary rigs: '{rotary}')"
