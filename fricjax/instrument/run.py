"""What happens to the mass of a synthetic run, as numbers: checked before anything moves."""

import dataclasses
import math
import numbers
from typing import Any

from ..errors import UsageError
from .checks import not_negative, number, positive

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
