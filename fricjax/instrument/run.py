"""Initial conditions and sampling of a synthetic run, with their checks."""

import dataclasses
import math
import numbers
from typing import Any

from ..errors import UsageError
from ..numbers import in_unit, number

# Minimum number of samples of a trace.
_FEWEST = 3


@dataclasses.dataclass(frozen=True)
class Run:
    """Motion of the mass and its sampling, without the instrument."""

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
    """Refuse an invalid seed of random numbers.

    Raises:
        UsageError: the seed is not an integer of zero or more.
    """
    if not isinstance(seed, numbers.Integral) or isinstance(seed, bool) or seed < 0:
        raise UsageError(f"seed must be a whole number, zero or more, got {seed!r}.")


def positive(name: str, value: Any, unit: str) -> float:
    """Convert the value to a positive float.

    Raises:
        UsageError: the value is not a finite number above zero.
    """
    result = number(name, value, unit)
    if result <= 0:
        raise UsageError(f"{name} must be a positive number{in_unit(unit)}, got {result:g}.")
    return result


def not_negative(name: str, value: Any, unit: str) -> float:
    """Convert the value to a non-negative float.

    Raises:
        UsageError: the value is not a finite number, or it is negative.
    """
    result = number(name, value, unit)
    if result < 0:
        raise UsageError(f"{name} must not be negative, got {result:g}{' ' + unit if unit else ''}; 0 switches it off.")
    return result


def pair(name: str, value: Any, unit: str) -> tuple[float, float]:
    """Convert one or two non-negative numbers to a pair.

    A single number becomes the first of the pair; the second is zero.

    Raises:
        UsageError: there are not one or two numbers, or one is negative.
    """
    values = tuple(value) if isinstance(value, tuple | list) else (value, 0.0)
    if len(values) != 2:
        raise UsageError(f"{name} must be one or two numbers{in_unit(unit)}, got {len(values)}: {value!r}.")
    first, second = (not_negative(name, item, unit) for item in values)
    return first, second
