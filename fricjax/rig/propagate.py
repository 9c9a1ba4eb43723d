"""First-order propagation of standard uncertainties through a formula (GUM, JCGM 100:2008, 5.1.2)."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import UsageError
from .measured import Measured


def propagated(formula: Callable[..., float], *inputs: Measured) -> Measured:
    """The value of a formula with the combined standard uncertainty of its independent inputs.

    The contribution of each input is half the change of the result between its value plus and minus its standard
    uncertainty (GUM, 5.1.3, note 2).

    Args:
        formula: takes one float per input and returns one float.
        inputs: the inputs in SI units, taken as uncorrelated.

    Returns:
        The result in the unit of the formula.
    """
    values = np.array([number.value for number in inputs], dtype=float)
    steps = np.diag([number.std for number in inputs])
    halves = [(formula(*(values + step)) - formula(*(values - step))) / 2 for step in steps]
    return Measured(formula(*values), float(np.linalg.norm(halves)))


def measured(name: str, given: Any) -> Measured:
    """A number, a `Measured`, or anything else with a value and its std, such as an estimate of a fit.

    Raises:
        UsageError: anything else, or a value that is not finite.
    """
    try:
        return (
            Measured(given.value, given.std) if hasattr(given, "std") and hasattr(given, "value") else Measured(given)
        )
    except UsageError as error:
        raise UsageError(f"{name} must be a number in SI units or a Measured, got {given!r}: {error}") from error


def positive(name: str, unit: str, given: Any) -> Measured:
    """The same, for what must be larger than zero.

    Raises:
        UsageError: zero, a negative number, or none at all.
    """
    number = measured(name, given)
    if not number.value > 0:
        raise UsageError(f"{name} must be a positive number of {unit}, got {number.value:g}.")
    return number
