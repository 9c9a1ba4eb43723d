"""Values with standard uncertainties, and their propagation through a formula.

Uncertainties are propagated to first order (GUM, JCGM 100:2008, 5.1.2).
"""

import dataclasses
import math
import sys
from collections.abc import Callable
from typing import Any

from ..errors import UsageError, brief
from ..show.numbers import uncertain


@dataclasses.dataclass(frozen=True)
class Measured:
    """A value with its standard uncertainty (k = 1).

    It is an input of a rig, or a result.

    Attributes:
        value: best estimate, NaN without an estimate. It may be traced, for derivatives with respect to it.
        std: standard uncertainty, not negative. Zero: exact; inf: undetermined; NaN: unknown.
        unit: unit of value and uncertainty, empty for a pure number. None: the SI unit of the quantity, such as kg for
            the mass of a rig.

    Raises:
        UsageError: the value or the uncertainty is not a number, the uncertainty is negative, or the unit is not a
            string.

    Examples:
        >>> import fricjax as fj
        >>> mass = fj.Measured(0.4107, 0.0012)
        >>> mass
        0.4107(12)
        >>> f"{100 * mass.relative:.2f} %"
        '0.29 %'
        >>> fj.Measured(12.6, 0.002, "Hz")
        12.6000(20) Hz
    """

    value: Any
    std: float = 0.0
    unit: str | None = None

    def __post_init__(self) -> None:
        for field in ("value", "std"):
            number = getattr(self, field)
            # The value of a tracer is unknown.
            if not is_traced(number):
                object.__setattr__(self, field, _number(field, number))
        if self.std < 0:
            raise UsageError(f"The standard uncertainty of a Measured must not be negative, got {self.std:g}.")
        if not isinstance(self.unit, str | None):
            raise UsageError(f"The unit of a Measured must be a text such as 'kg', got {brief(self.unit)}.")

    @property
    def is_finite(self) -> bool:
        """True if both numbers are finite; a traced value counts as finite."""
        return math.isfinite(self.std) and (is_traced(self.value) or math.isfinite(self.value))

    @property
    def relative(self) -> float:
        """Standard uncertainty over the absolute value [1]; infinite for zero."""
        return self.std / abs(self.value) if self.value else (math.inf if self.std else 0.0)

    def __repr__(self) -> str:
        if is_traced(self.value):
            return f"Measured({self.value}, {self.std:g})"
        unit = self.unit or ""
        return uncertain(self.value, self.std, unit) if self.std > 0 else f"{self.value:.10g} {unit}".rstrip()

    def _asdict(self) -> dict[str, Any]:
        """Fields by name, as in a named tuple; `unit` only if given."""
        fields = {"value": self.value, "std": self.std}
        return fields if self.unit is None else {**fields, "unit": self.unit}


def is_traced(value: Any) -> bool:
    """Return True if JAX traces the value, without importing JAX."""
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)


def _number(field: str, number: Any) -> float:
    # Python treats a bool as a number, and `float` accepts text. NumPy is not imported here, so its scalars and
    # zero-dimensional arrays are recognised by the attributes dtype and ndim.
    boolean = isinstance(number, bool) or getattr(getattr(number, "dtype", None), "kind", "") == "b"
    single = not boolean and not isinstance(number, str) and getattr(number, "ndim", 0) == 0
    try:
        converted = float(number) if single else None
    except (TypeError, ValueError, OverflowError):
        converted = None
    if converted is None:
        raise UsageError(f"The {field} of a Measured must be one number, got {brief(number)}.")
    return converted


def positive(name: str, unit: str, value: Any) -> Measured:
    """Convert a number to a `Measured`, and check that it is positive.

    Raises:
        UsageError: the value is not a finite number above zero.
    """
    try:
        number = value if isinstance(value, Measured) else Measured(value)
    except UsageError as error:
        raise UsageError(f"{name} must be a number in SI units or a Measured, got {value!r}: {error}") from error
    if not number.is_finite:
        raise UsageError(f"{name} must be a finite number of {unit}, got {number!r}.")
    if not number.value > 0:
        raise UsageError(f"{name} must be a positive number of {unit}, got {number.value:g}.")
    return number


def propagated(formula: Callable[..., float], *inputs: Measured) -> Measured:
    """Evaluate a formula and the combined standard uncertainty of its result.

    Args:
        formula: function of one float per input that returns one float.
        inputs: the inputs in SI units, assumed to be uncorrelated.

    Returns:
        The result in the unit of the formula.
    """
    import numpy as np

    values = np.array([number.value for number in inputs], dtype=float)
    steps = np.diag([number.std for number in inputs])
    # Half the change between value plus and minus uncertainty replaces the derivative (GUM, 5.1.3, note 2), so JAX need
    # not differentiate the formula.
    halves = [(formula(*(values + step)) - formula(*(values - step))) / 2 for step in steps]
    return Measured(formula(*values), float(np.linalg.norm(halves)))
