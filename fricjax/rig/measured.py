"""A value with its standard uncertainty, calibrated or determined, and what a formula makes of several of them.

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
    """A value with its standard uncertainty (k = 1): an input of a rig, or what a fit or a route has determined.

    Attributes:
        value: best estimate, NaN where there is none; may be traced where a derivative with respect to it is taken.
        std: standard uncertainty, not negative; zero: exact, inf: undetermined, NaN: not known.
        unit: of both, empty for a pure number; None: the SI unit that belongs to its place, as to the mass of a rig.

    Raises:
        UsageError: a value or uncertainty that is no number, a negative uncertainty, or a unit that is no text.

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
            # The value of a tracer is not known yet.
            if not is_traced(number):
                object.__setattr__(self, field, _number(field, number))
        if self.std < 0:
            raise UsageError(f"The standard uncertainty of a Measured must not be negative, got {self.std:g}.")
        if not isinstance(self.unit, str | None):
            raise UsageError(f"The unit of a Measured must be a text such as 'kg', got {brief(self.unit)}.")

    @property
    def is_finite(self) -> bool:
        """Whether both are finite numbers, as those of a rig must be; a traced value counts as one."""
        return math.isfinite(self.std) and (is_traced(self.value) or math.isfinite(self.value))

    @property
    def relative(self) -> float:
        """Standard uncertainty as a fraction of the value [1]; infinite for a value of zero."""
        return self.std / abs(self.value) if self.value else (math.inf if self.std else 0.0)

    def __repr__(self) -> str:
        if is_traced(self.value):
            return f"Measured({self.value}, {self.std:g})"
        unit = self.unit or ""
        return uncertain(self.value, self.std, unit) if self.std > 0 else f"{self.value:.10g} {unit}".rstrip()

    def _asdict(self) -> dict[str, Any]:
        """The fields by name, as a named tuple gives them; a unit that its place says is left out."""
        fields = {"value": self.value, "std": self.std}
        return fields if self.unit is None else {**fields, "unit": self.unit}


def is_traced(value: Any) -> bool:
    """Whether JAX traces a value; without JAX in memory none is, and it is not loaded to be asked."""
    jax = sys.modules.get("jax")
    return jax is not None and isinstance(value, jax.core.Tracer)


def _number(field: str, number: Any) -> float:
    # A truth value is a number to Python, and a text one to `float`. NumPy's scalars and arrays without dimensions are
    # told by their own kind and shape, for NumPy is not imported here.
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
    """A number or a `Measured`, refused where it is not finite and larger than zero.

    Raises:
        UsageError: zero, a negative number, or none at all.
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
    """The value of a formula with the combined standard uncertainty of its independent inputs.

    Args:
        formula: takes one float per input and returns one float.
        inputs: the inputs in SI units, taken as uncorrelated.

    Returns:
        The result in the unit of the formula.
    """
    import numpy as np

    values = np.array([number.value for number in inputs], dtype=float)
    steps = np.diag([number.std for number in inputs])
    # Half the change between value plus and minus uncertainty stands for the derivative (GUM, 5.1.3, note 2), so that
    # a formula need not be one that JAX can differentiate.
    halves = [(formula(*(values + step)) - formula(*(values - step))) / 2 for step in steps]
    return Measured(formula(*values), float(np.linalg.norm(halves)))
