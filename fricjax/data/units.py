"""Conversion of the units in files and options to SI.

A unit is a product of powers of known symbols. Unit texts come from files of unknown origin, so a small grammar parses
them and `eval` is never used. Records need only units of length, angle and time. The other units (mass, force, ...)
serve to recognise a row of units above a table and to read rig files.
"""

import functools
import math
import re
from collections import Counter
from typing import Any, NamedTuple

from ..errors import DataError, UsageError, check_type

EXAMPLES = {"m": "'m', 'mm', 'um' or 'nm'", "rad": "'rad', 'mrad' or 'deg'", "s": "'s', 'ms' or 'us'"}
EXAMPLES |= {"m/s": "'m/s'", "rad/s": "'rad/s' or 'deg/s'", "m/s^2": "'m/s^2' or 'g'", "rad/s^2": "'rad/s^2'"}
DISPLACEMENT = ("m", "rad")
READING = (*DISPLACEMENT, "m/s", "rad/s", "m/s^2", "rad/s^2")
"""SI units of displacements, velocities and accelerations."""
TIME = ("s",)
# Number of quantities that a message shows by examples, and spellings of quotients.
_SHOWN = 4
_QUOTIENTS = {"m s^-1": "m/s", "rad s^-1": "rad/s", "m s^-2": "m/s^2", "rad s^-2": "rad/s^2"}
LONGEST = 40
"""Length of the longest text that can be a unit, in characters; "kg m^2/s^2" has ten."""


class Unit(NamedTuple):
    """A unit: factor to SI and non-zero powers of SI units."""

    scale: float
    powers: dict[str, int]

    @property
    def symbol(self) -> str:
        """The SI unit, such as `"kg m s^-2"`; empty if dimensionless."""
        return " ".join(name if power == 1 else f"{name}^{power}" for name, power in sorted(self.powers.items()))


_PREFIXES = {
    "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 0.1, "": 1.0,
    "da": 10.0, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9, "T": 1e12,
    "femto": 1e-15, "pico": 1e-12, "nano": 1e-9, "micro": 1e-6, "milli": 1e-3, "centi": 1e-2, "kilo": 1e3, "mega": 1e6,
}  # fmt: skip
_FORCE, _PRESSURE = {"kg": 1, "m": 1, "s": -2}, {"kg": 1, "m": -1, "s": -2}
_VOLTAGE = {"kg": 1, "m": 2, "s": -3, "A": -1}
_ENERGY = {"kg": 1, "m": 2, "s": -2}
_GRAVITY = 9.80665  # standard gravity [m/s^2], which defines the kilogram-force
_POUND = 0.45359237  # [kg], by definition
# Units that take a prefix: a symbol before a symbol ("mm"), a word before a word ("millimetre").
_PREFIXED = {
    "m": Unit(1.0, {"m": 1}),
    "s": Unit(1.0, {"s": 1}),
    "rad": Unit(1.0, {"rad": 1}),
    "g": Unit(1e-3, {"kg": 1}),
    "N": Unit(1.0, _FORCE),
    "Hz": Unit(1.0, {"s": -1}),
    "Pa": Unit(1.0, _PRESSURE),
    "bar": Unit(1e5, _PRESSURE),
    "J": Unit(1.0, _ENERGY),
    "W": Unit(1.0, {"kg": 1, "m": 2, "s": -3}),
    "V": Unit(1.0, _VOLTAGE),
    "A": Unit(1.0, {"A": 1}),
    "K": Unit(1.0, {"K": 1}),
    "sec": Unit(1.0, {"s": 1}),
    "arcsec": Unit(math.pi / 648000, {"rad": 1}),
    "deg": Unit(math.pi / 180, {"rad": 1}),
    "gf": Unit(1e-3 * _GRAVITY, _FORCE),
    **dict.fromkeys(("metre", "meter", "metres", "meters"), Unit(1.0, {"m": 1})),
    **dict.fromkeys(("second", "seconds"), Unit(1.0, {"s": 1})),
    **dict.fromkeys(("radian", "radians"), Unit(1.0, {"rad": 1})),
    **dict.fromkeys(("gram", "grams"), Unit(1e-3, {"kg": 1})),
    **dict.fromkeys(("newton", "newtons"), Unit(1.0, _FORCE)),
    **dict.fromkeys(("volt", "volts"), Unit(1.0, _VOLTAGE)),
    # Standard gravity. Accelerometers call it g, which is a gram elsewhere: see `gravity`.
    "gn": Unit(_GRAVITY, {"m": 1, "s": -2}),
    "hertz": Unit(1.0, {"s": -1}),
    "Nm": Unit(1.0, _ENERGY),
}
_UNPREFIXED = {
    **dict.fromkeys(("micron", "microns"), Unit(1e-6, {"m": 1})),
    **dict.fromkeys(("Å", "angstrom"), Unit(1e-10, {"m": 1})),
    **dict.fromkeys(("in", "inch", "inches"), Unit(0.0254, {"m": 1})),
    **dict.fromkeys(("uin", "microinch"), Unit(2.54e-8, {"m": 1})),
    "thou": Unit(2.54e-5, {"m": 1}),
    **dict.fromkeys(("ft", "foot", "feet"), Unit(0.3048, {"m": 1})),
    **dict.fromkeys(("°", "degree", "degrees", "Grad"), Unit(math.pi / 180, {"rad": 1})),
    "arcmin": Unit(math.pi / 10800, {"rad": 1}),
    **dict.fromkeys(("gon", "grad"), Unit(math.pi / 200, {"rad": 1})),
    **dict.fromkeys(("turn", "turns", "revolution", "revolutions"), Unit(2 * math.pi, {"rad": 1})),
    "rpm": Unit(math.pi / 30, {"rad": 1, "s": -1}),
    **dict.fromkeys(("secs", "Sek", "Sekunde", "Sekunden"), Unit(1.0, {"s": 1})),
    **dict.fromkeys(("min", "minute", "minutes"), Unit(60.0, {"s": 1})),
    **dict.fromkeys(("h", "hr", "hour", "hours"), Unit(3600.0, {"s": 1})),
    **dict.fromkeys(("d", "day", "days"), Unit(86400.0, {"s": 1})),
    **dict.fromkeys(("lb", "lbs", "pound", "pounds"), Unit(_POUND, {"kg": 1})),
    "oz": Unit(_POUND / 16, {"kg": 1}),
    "lbf": Unit(_POUND * _GRAVITY, _FORCE),
    "ozf": Unit(_POUND / 16 * _GRAVITY, _FORCE),
    "dyn": Unit(1e-5, _FORCE),
    "psi": Unit(_POUND * _GRAVITY / 0.0254**2, _PRESSURE),
    **dict.fromkeys(("degC", "°C", "celsius"), Unit(1.0, {"K": 1})),
    **dict.fromkeys(("%", "percent"), Unit(1e-2, {})),
    "‰": Unit(1e-3, {}),
    "ppm": Unit(1e-6, {}),
    "1": Unit(1.0, {}),
}
_SPELT = str.maketrans(
    {"µ": "u", "μ": "u", "\u212b": "Å", "℃": "°C", ".": "*", "·": "*", "⋅": "*", "×": "*", "⁻": "^-"}
    | {digit: f"^{value}" for value, digit in enumerate("⁰¹²³⁴⁵⁶⁷⁸⁹")}
)
# A symbol with a one-digit power, or a product in brackets; "1" is allowed only before a quotient.
_ITEM = re.compile(
    r"\s*(?P<mark>[*/]?)\s*(?:\((?P<group>[^()]*)\)"
    r"|(?P<name>[^\W\d_]+|°C?|[%‰]|1(?=\s*/))(?:(?:\^|\*\*)(?P<power>[-+]?\d)(?!\d))?)"
)


@functools.lru_cache(maxsize=256)
def unit_of(text: str) -> Unit | None:
    """Parse a unit such as `"um"`, `"N s/m"` or `"kg m^2"`.

    Returns None if the text is not a unit.
    """
    if len(text) > LONGEST:
        return None
    # A two-character superscript, such as that of s⁻¹, has become two power signs.
    unit = _product(text.strip().rstrip(".").translate(_SPELT).replace("^-^", "^-"))
    return unit if unit is not None and 0 < unit.scale < math.inf else None


def _product(text: str) -> Unit | None:
    """Multiply and divide symbols, powers and groups from left to right.

    Returns None if the text contains anything else.
    """
    scale, powers, place = 1.0, Counter[str](), 0
    text = text.strip()
    while place < len(text) or not text:
        match = _ITEM.match(text, place)
        if match is None or (place == 0 and match["mark"]):
            return None
        item = _symbol(match["name"]) if match["group"] is None else _product(match["group"])
        if item is None:
            return None
        power = int(match["power"] or 1) * (-1 if match["mark"] == "/" else 1)
        scale *= item.scale**power
        powers.update({name: power * exponent for name, exponent in item.powers.items()})
        place = match.end()
    return Unit(scale, {name: power for name, power in powers.items() if power})


def _symbol(name: str) -> Unit | None:
    """Return the unit with this name, with or without a prefix."""
    if name in _UNPREFIXED:
        return _UNPREFIXED[name]
    for prefix, multiple in _PREFIXES.items():
        base = _PREFIXED.get(name[len(prefix) :]) if name.startswith(prefix) else None
        if base is not None:
            return Unit(multiple * base.scale, base.powers)
    return None


def si_unit(unit: str) -> tuple[float, str] | None:
    """Return factor to SI and SI unit, (1e-6, "m") for "um".

    Returns None if the text is not a unit.
    """
    check_type("A unit", unit, str, "a text")
    known = unit_of(unit)
    return None if known is None else (known.scale, known.symbol)


def factor(unit: str, quantities: tuple[str, ...], subject: str) -> tuple[float, str]:
    """Return the factor from `unit` to SI and its quantity.

    The quantity is the member of `quantities` ("m", "rad", "s") that the unit measures.

    Args:
        unit: a unit as written in a header or by the user.
        quantities: the SI units that fit.
        subject: the quantity with this unit, for the message: "the displacement 'x' of run.csv".

    Raises:
        DataError: the text is not a unit, or the unit does not fit; the message names examples that fit.
    """
    fitting = " or ".join(EXAMPLES[quantity] for quantity in quantities[:_SHOWN])
    known = si_unit(unit)
    if known is None:
        shown = unit if len(unit) <= LONGEST else f"{unit[:LONGEST]}..."
        raise DataError(f"'{shown}' is not a known unit, but {subject} has it; give one such as {fitting}.")
    scale, quantity = known[0], _QUOTIENTS.get(known[1], known[1])
    if quantity not in quantities:
        raise DataError(f"The unit '{unit}' does not fit {subject}; units that fit are {fitting}.")
    return scale, quantity


def gravity(unit: str | None) -> str | None:
    """Return the unit of an acceleration, with "g" as standard gravity."""
    return f"{unit.strip()}n" if isinstance(unit, str) and unit.strip() in ("g", "mg") else unit


def check_rate(rate: Any) -> None:
    """Refuse a sample rate that is not a positive, finite number."""
    try:
        usable = 0 < float(rate) < math.inf
    except (TypeError, ValueError):
        usable = False
    if not usable:
        raise UsageError(f"rate must be a positive number of samples per second, but it is {rate!r}.")
