"""What happens to the mass of a synthetic run, as numbers: checked before anything moves."""

import dataclasses
import math
import numbers
from typing import Any

from ..errors import UsageError

# As many as a trace needs.
_FEWEST = 3


@dataclasses.dataclass(frozen=True)
class Run:
    """What happens to the mass before any instrument looks."""

    x0: float
    v0: float
    rate: float
    duration: float
    hold: float
    release_time_constant: float
    floor_acceleration_psd: float

    def __post_init__(self) -> None:
        for name, unit in (("x0", "m"), ("v0", "m/s")):
            object.__setattr__(self, name, number(name, getattr(self, name), unit))
        for name, unit in (("rate", "Hz"), ("duration", "s")):
            object.__setattr__(self, name, positive(name, getattr(self, name), unit))
        for name, unit in (("hold", "s"), ("release_time_constant", "s"), ("floor_acceleration_psd", "(m/s^2)^2/Hz")):
            object.__setattr__(self, name, not_negative(name, getattr(self, name), unit))
        if self.samples < _FEWEST:
            raise UsageError(
                f"A run of {self.duration:g} s at {self.rate:g} Hz has {self.samples} samples, and at least "
                f"{_FEWEST} are needed; make rate or duration larger."
            )
        if self.hold >= self.duration:
            raise UsageError(
                f"hold is {self.hold:g} s, but the whole run lasts {self.duration:g} s; make duration larger than hold."
            )

    @property
    def samples(self) -> int:
        return math.floor(self.rate * self.duration + 1e-6)


def check_seed(seed: Any) -> None:
    """Refuse what random numbers cannot follow from.

    Raises:
        UsageError: no whole number of zero or more.
    """
    if not isinstance(seed, numbers.Integral) or isinstance(seed, bool) or seed < 0:
        raise UsageError(f"seed must be a whole number, zero or more, got {seed!r}.")


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
