"""A calibrated number: its value and its standard uncertainty, as a calibration certificate states them."""

import dataclasses
import math
import sys
from typing import Any

from ..errors import UsageError, brief
from ..show.numbers import uncertain


@dataclasses.dataclass(frozen=True)
class Measured:
    """A measured input with its standard uncertainty (k = 1), both in SI units.

    Attributes:
        value: best estimate; may be traced where a derivative with respect to it is taken.
        std: standard uncertainty, finite and not negative; zero: taken as exact.

    Raises:
        UsageError: a value or uncertainty that is no finite number, or a negative uncertainty.
    """

    value: Any
    std: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", _finite("value", self.value))
        object.__setattr__(self, "std", _finite("std", self.std))
        if self.std < 0:
            raise UsageError(f"The standard uncertainty of a Measured must not be negative, got {self.std:g}.")

    @property
    def relative(self) -> float:
        """Standard uncertainty as a fraction of the value [1]; infinite for a value of zero."""
        return self.std / abs(self.value) if self.value else (math.inf if self.std else 0.0)

    def __repr__(self) -> str:
        if is_traced(self.value):
            return f"Measured({self.value}, {self.std:g})"
        return uncertain(self.value, self.std) if self.std > 0 else f"{self.value:.10g}"


def is_traced(value: Any) -> bool:
    """Whether a value is not known yet, for JAX traces it; without JAX none is."""
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)


def _finite(field: str, number: Any) -> Any:
    """A finite float; a tracer passes, for its value is not known yet."""
    if is_traced(number):
        return number
    # Numbers of NumPy and arrays of none dimension know their own kind and shape.
    boolean = isinstance(number, bool) or getattr(getattr(number, "dtype", None), "kind", "") == "b"
    single = not boolean and not isinstance(number, str) and getattr(number, "ndim", 0) == 0
    try:
        converted = float(number) if single else None
    except (TypeError, ValueError, OverflowError):
        converted = None
    if converted is None:
        raise UsageError(f"The {field} of a Measured must be one number, got {brief(number)}.")
    if not math.isfinite(converted):
        raise UsageError(f"The {field} of a Measured must be finite, got {converted}.")
    return converted
