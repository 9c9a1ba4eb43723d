"""Parsing of command-line values.

Accepted forms are ``a,b``, ``a=1,b=2``, ``a=0:1``, ``a=0.17(1)``, ``1:9`` and ``2 mm``. For other texts a `UsageError`
names the option and shows a valid example.
"""

import re
from collections.abc import Iterable

from ..errors import UsageError
from ..show.numbers import parse_uncertain


def words(texts: Iterable[str] | str | None) -> list[str]:
    """Split one or several options at commas."""
    texts = [texts] if isinstance(texts, str) else texts or ()
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]


def pairs(option: str, texts: Iterable[str] | None, example: str) -> dict[str, str]:
    """Parse ``name=text`` pairs; messages contain `option` and `example`."""
    values: dict[str, str] = {}
    for word in words(texts):
        name, equals, text = (part.strip() for part in word.partition("="))
        if not (name and equals and text):
            raise UsageError(f"{option} '{word}' is not of the form name=value; write for example {option} {example}.")
        if name in values:
            raise UsageError(f"{option} gives {name} twice, as {values[name]} and as {text}.")
        values[name] = text
    return values


def number(what: str, text: str) -> float:
    """Parse a finite number."""
    try:
        value = float(text)
    except ValueError as error:
        raise UsageError(f"{what} must be a number, got '{text}'.") from error
    if not abs(value) < float("inf"):
        raise UsageError(f"{what} must be finite, got {text}.")
    return value


def span(option: str, text: str) -> tuple[float | None, float | None]:
    """Parse two ends as ``low:high``; a missing end is None."""
    low, colon, high = (part.strip() for part in text.partition(":"))
    if not colon or not (low or high):
        raise UsageError(f"{option} '{text}' is no span; write low:high, low: or :high.")
    ends = [number(f"An end of {option}", end) if end else None for end in (low, high)]
    return ends[0], ends[1]


def estimate(what: str, text: str) -> tuple[float, float]:
    """Parse a value with its standard deviation in SI units.

    Accepted forms are ``0.170(12)`` and ``0.17+/-0.012``.
    """
    value, std, unit = parse_uncertain(text) or (0.0, 0.0, "")
    if not std > 0 or unit:
        raise UsageError(f"{what} needs a value with its standard deviation, in SI units, as 0.175(2); got '{text}'.")
    return value, std


def tied(text: str) -> tuple[str, float]:
    """Parse a parameter with an optional factor, as ``mu`` or ``1.3*mu``."""
    match = re.fullmatch(r"(?:(?P<factor>[^*]+)\*)?\s*(?P<name>[A-Za-z_][\w.\[\]]*)", text.strip())
    if match is None:
        raise UsageError(f"--tie cannot follow '{text}'; write for example --tie mu_s=mu or --tie mu_s=1.3*mu.")
    return match["name"], number("The factor of a tie", match["factor"]) if match["factor"] else 1.0


def displacement(option: str, text: str) -> float:
    """Parse a displacement, as ``2e-3``, ``2 mm`` or ``5 deg``."""
    value, std, unit = parse_uncertain(text) or (0.0, -1.0, "")
    if std:
        raise UsageError(f"{option} must be a displacement such as 2e-3 or '2 mm', got '{text}'.")
    if not unit:
        return value
    from ..data.units import DISPLACEMENT, factor
    from ..errors import DataError

    try:
        return value * factor(unit, DISPLACEMENT, option)[0]
    except DataError as error:
        raise UsageError(str(error)) from error


def per_second(option: str, text: str) -> float:
    """Parse a number per second, as ``10000``, ``10k`` or ``1.25M``."""
    # A capital M, because m means milli.
    factor = {"k": 1e3, "M": 1e6}.get(text.strip()[-1:], 1.0)
    return factor * number(option, text.strip().rstrip("kM") if factor > 1 else text)
