"""Numbers as text, with standard uncertainties and SI prefixes.

For example 0.21452(31), or 12.3 um. The two digits in brackets are the standard uncertainty in units of the last digits
shown (GUM 7.2.2). A fixed or undetermined value is marked with this word, and never printed with a zero uncertainty.
"""

import math
import re
from decimal import ROUND_HALF_EVEN, Context, Decimal

from .units import display_unit

# The package `uncertainties` writes and reads the same shorthand, but it imports NumPy, which would double the start-up
# time of the command line.

# 1e308 with an uncertainty of 5e-324 has 309 digits before and 325 after the point, and a saved fit may contain it.
_ROUNDED = Context(prec=700, rounding=ROUND_HALF_EVEN)
_SMALLEST_FIXED = -4  # below 1e-4 an exponent is easier to read than leading zeros


def uncertain(value: float, std: float | None, unit: str = "") -> str:
    """Write a value with its standard uncertainty in shorthand.

    Args:
        value: the estimate.
        std: its standard uncertainty, in the unit of the value. None or 0: fixed. inf or nan: undetermined.
        unit: appended after a space.

    Returns:
        For example `0.21452(31)`, `120.3(1.2) N/m`, `1.002(34)e-05 m/s`, `0.0100 (fixed)`, `0.0100 (undetermined)`.

    Raises:
        ValueError: `std` is negative.

    Examples:
        >>> from fricjax.show import uncertain
        >>> uncertain(0.214523, 0.000312), uncertain(120.34, 1.23, "N/m"), uncertain(0.01, None)
        ('0.21452(31)', '120.3(1.2) N/m', '0.0100 (fixed)')
    """
    if std is not None and std < 0:
        raise ValueError(f"A standard uncertainty cannot be negative, got {std}: give its absolute value.")
    if not math.isfinite(value):
        return "undetermined"
    if std is None or std == 0:
        return f"{_with_unit(plain(value), unit)} (fixed)"
    if not math.isfinite(std):
        return f"{_with_unit(plain(value), unit)} (undetermined)"
    return _with_unit(_shorthand(Decimal(repr(float(value))), Decimal(repr(float(std)))), unit)


def plain(value: float, digits: int = 6) -> str:
    """Write a number with three to `digits` significant digits.

    Examples:
        >>> from fricjax.show import plain
        >>> plain(0.01), plain(0.2145234), plain(1e-5)
        ('0.0100', '0.214523', '1.00e-05')
    """
    if isinstance(value, int) or not math.isfinite(value):
        return str(value)
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    significant = max(3, len(mantissa.lstrip("-").replace(".", "").rstrip("0")))
    if _SMALLEST_FIXED <= int(exponent) < digits:
        return f"{value:.{max(significant - 1 - int(exponent), 0)}f}"
    return f"{value:.{significant - 1}e}"


def engineering(value: float, unit: str, digits: int = 3) -> str:
    """Write a value with an SI prefix and at most `digits` digits.

    Examples:
        >>> from fricjax.show import engineering
        >>> engineering(12.3e-6, "m"), engineering(1500.0, "N/m")
        ('12.3 um', '1.5 kN/m')
    """
    if not math.isfinite(value):
        return _with_unit(str(value), unit)
    rounded = float(f"{value:.{digits - 1}e}")
    factor, shown = display_unit(rounded, unit)
    # Three digits before the point need no exponent, even if fewer of them are significant.
    return _with_unit(f"{rounded * factor:.{max(digits, 3)}g}", shown)


def interval(low: float, high: float, unit: str = "") -> str:
    """Write the ends of an interval with enough digits to distinguish them.

    Examples:
        >>> from fricjax.show import interval
        >>> interval(0.21014, 0.21344)
        '[0.2101, 0.2134]'
    """
    width = high - low
    if not math.isfinite(width) or width <= 0:
        return _with_unit(f"[{plain(low)}, {plain(high)}]", unit)
    largest = max(abs(low), abs(high))
    digits = min(max(math.floor(math.log10(largest)) - math.floor(math.log10(width)) + 2, 3), 15)
    return _with_unit(f"[{plain(low, digits)}, {plain(high, digits)}]", unit)


def duration(seconds: float) -> str:
    """Write a duration in seconds, minutes or hours.

    Examples:
        >>> from fricjax.show import duration
        >>> duration(3.2e-3), duration(125.0), duration(3780.0)
        ('3.2 ms', '2 min 05 s', '1 h 03 min')
    """
    # Above 59.95 s three digits would round to a minute.
    if not math.isfinite(seconds) or abs(seconds) < 59.95:
        return engineering(seconds, "s")
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes:02d} min"


def _shorthand(value: Decimal, std: Decimal) -> str:
    """Write value and uncertainty, rounded at the second digit of the uncertainty."""
    last = std.adjusted() - 1
    # Rounding can carry (0.0996 becomes 0.10), which moves the second digit up by one place.
    last = std.quantize(Decimal(1).scaleb(last), context=_ROUNDED).adjusted() - 1
    step = Decimal(1).scaleb(last)
    leading = max(value.quantize(step, context=_ROUNDED).adjusted() if value else last, last + 1)
    if last > 0 or leading < _SMALLEST_FIXED:
        return f"{_bracket(value.scaleb(-leading), std.scaleb(-leading), last - leading)}e{leading:+03d}"
    return _bracket(value, std, last)


def _bracket(value: Decimal, std: Decimal, last: int) -> str:
    """Write `value(std)` with digits down to `10^last`, `last` <= 0."""
    step = Decimal(1).scaleb(last)
    value, std = value.quantize(step, context=_ROUNDED), std.quantize(step, context=_ROUNDED)
    digits = f"{std:f}" if std >= 1 else f"{std.scaleb(-last):.0f}"
    return f"{value:f}({digits})"


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
# Two numbers and a unit have at most this many characters. Longer texts are refused first, because the pattern would
# try every way to divide them.
LONGEST = 120
_UNCERTAIN = re.compile(
    rf"\s*(?P<value>{NUMBER})(?:\((?P<digits>\d+\.?\d*)\))?(?P<exponent>[eE][-+]?\d+)?"
    rf"(?:\s*(?:\+/-|±)\s*(?P<std>{NUMBER}(?:[eE][-+]?\d+)?)\s*(?P<percent>%)?)?\s*(?P<unit>(?:1/)?[^\d\s].*?)?\s*"
)


def parse_uncertain(text: str) -> tuple[float, float, str] | None:
    """Parse a value with its standard uncertainty and unit.

    Args:
        text: such as ``"410.7(3) g"``, ``"9.66 +/- 0.05 N"``, ``"9.66 ± 0.5 % N"`` or ``"2 mm"``. Digits in brackets
            are in units of the last digits of the value. With a point, as in ``120.3(1.2)``, they are in the unit of
            the value. A percentage is relative to the value.

    Returns:
        Value and standard uncertainty, both in the unit of the text, and this unit, which may be empty. A missing
        uncertainty is zero. None if the text is not such a number.

    Examples:
        >>> from fricjax.show import parse_uncertain
        >>> parse_uncertain("410.7(3) g"), parse_uncertain("9.66 +/- 0.5 % N"), parse_uncertain("heavy")
        ((410.7, 0.3, 'g'), (9.66, 0.0483, 'N'), None)
    """
    match = _UNCERTAIN.fullmatch(text) if len(text) <= LONGEST else None
    if match is None or (match["digits"] and match["std"]):
        return None
    exponent = match["exponent"] or ""
    value, std = float(match["value"] + exponent), 0.0
    if match["digits"] and "." in match["digits"]:
        std = float(match["digits"] + exponent)
    elif match["digits"]:
        decimals = len(match["value"].partition(".")[2])
        std = float(f"{match['digits']}e{-decimals}") * float("1" + exponent)
    elif match["std"]:
        std = float(match["std"]) * (abs(value) / 100 if match["percent"] else 1.0)
    return value, std, match["unit"] or ""
