"""Numbers as the field prints them: 0.21452(31) for a value with its standard uncertainty, 12.3 um for a length.

The digits in brackets are the standard uncertainty in units of the last digits shown (GUM 7.2.2), two of them always.
What was held fixed and what the data do not determine is said in words and never printed as a zero uncertainty.
"""

import math
from decimal import ROUND_HALF_EVEN, Context, Decimal

from fricjax.show.units import display_unit

# The largest of all numbers with the uncertainty of the smallest has so many digits, as a file can hold it.
_ROUNDED = Context(prec=700, rounding=ROUND_HALF_EVEN)
_SMALLEST_FIXED = -4  # below 1e-4 the leading zeros take longer to count than an exponent to read


def uncertain(value: float, std: float | None, unit: str = "") -> str:
    """A value with its standard uncertainty in shorthand.

    Args:
        value: the estimate.
        std: its standard uncertainty, in the unit of the value. None or 0: held fixed. inf or nan: undetermined.
        unit: appended after a space.

    Returns:
        For example `0.21452(31)`, `120.3(1.2) N/m`, `1.002(34)e-05 m/s`, `0.0100 (fixed)`, `0.0100 (undetermined)`.

    Raises:
        ValueError: if `std` is negative.
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
    """A bare number with at most `digits` and at least three significant digits: `0.0100`, `0.214523`, `1.00e-05`."""
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
    """A value with an SI prefix and at most `digits` significant digits: `12.3 um`, `5 nm`, `1.5 kN/m`."""
    if not math.isfinite(value):
        return _with_unit(str(value), unit)
    rounded = float(f"{value:.{digits - 1}e}")
    factor, shown = display_unit(rounded, unit)
    # Three digits before the point need no exponent, however few of them count.
    return _with_unit(f"{rounded * factor:.{max(digits, 3)}g}", shown)


def interval(low: float, high: float, unit: str = "") -> str:
    """The two ends of an interval with as many digits as tell them apart: `[0.2101, 0.2134]`."""
    width = high - low
    if not math.isfinite(width) or width <= 0:
        return _with_unit(f"[{plain(low)}, {plain(high)}]", unit)
    largest = max(abs(low), abs(high))
    digits = min(max(math.floor(math.log10(largest)) - math.floor(math.log10(width)) + 2, 3), 15)
    return _with_unit(f"[{plain(low, digits)}, {plain(high, digits)}]", unit)


def duration(seconds: float) -> str:
    """A span of time as one says it: `3.2 ms`, `4.7 s`, `2 min 05 s`, `1 h 03 min`."""
    if not math.isfinite(seconds) or abs(seconds) < 59.95:
        return engineering(seconds, "s")
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes:02d} min"


def _shorthand(value: Decimal, std: Decimal) -> str:
    """Value and standard uncertainty, rounded at the second digit of the latter."""
    last = _last_digit(std)
    step = Decimal(1).scaleb(last)
    leading = max(value.quantize(step, context=_ROUNDED).adjusted() if value else last, last + 1)
    if last > 0 or leading < _SMALLEST_FIXED:
        return f"{_bracket(value.scaleb(-leading), std.scaleb(-leading), last - leading)}e{leading:+03d}"
    return _bracket(value, std, last)


def _last_digit(std: Decimal) -> int:
    """Power of ten of the second significant digit, after rounding has carried (0.0996 becomes 0.10)."""
    last = std.adjusted() - 1
    return std.quantize(Decimal(1).scaleb(last), context=_ROUNDED).adjusted() - 1


def _bracket(value: Decimal, std: Decimal, last: int) -> str:
    """`value(std)` with the digits down to the power of ten `last`, which is not positive."""
    step = Decimal(1).scaleb(last)
    value, std = value.quantize(step, context=_ROUNDED), std.quantize(step, context=_ROUNDED)
    digits = f"{std:f}" if std >= 1 else f"{std.scaleb(-last):.0f}"
    return f"{value:f}({digits})"


def _with_unit(text: str, unit: str) -> str:
    """Number, space, unit; no space where there is no unit."""
    return f"{text} {unit}" if unit else text
