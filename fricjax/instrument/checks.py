"""Checks of the numbers that describe a synthetic run; each refusal is one sentence."""

import math
from typing import Any

from ..errors import UsageError


def number(name: str, value: Any, unit: str = "") -> float:
    """The value as a finite float.

    Raises:
        UsageError: it is no single finite number.
    """
    try:
        result = float(value)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be one number{_in(unit)}, got {value!r}.") from error
    if not math.isfinite(result):
        raise UsageError(f"{name} must be a finite number{_in(unit)}, got {value!r}.")
    return result


def positive(name: str, value: Any, unit: str) -> float:
    """The value as a float above zero.

    Raises:
        UsageError: it is no finite number above zero.
    """
    result = number(name, value, unit)
    if result <= 0:
        raise UsageError(f"{name} must be a positive number{_in(unit)}, got {result:g}.")
    return result


def not_negative(name: str, value: Any, unit: str) -> float:
    """The value as a float that is zero or more.

    Raises:
        UsageError: it is no finite number, or one below zero.
    """
    result = number(name, value, unit)
    if result < 0:
        raise UsageError(f"{name} must not be negative, got {result:g}{' ' + unit if unit else ''}; 0 switches it off.")
    return result


def pair(name: str, value: Any, unit: str) -> tuple[float, float]:
    """Two numbers that are zero or more; a single one stands for itself and zero.

    Raises:
        UsageError: neither one number nor two, or one below zero.
    """
    values = tuple(value) if isinstance(value, tuple | list) else (value, 0.0)
    if len(values) != 2:
        raise UsageError(f"{name} must be one or two numbers{_in(unit)}, got {len(values)}: {value!r}.")
    first, second = (not_negative(name, item, unit) for item in values)
    return first, second


def _in(unit: str) -> str:
    return f" of {unit}" if unit else ""
