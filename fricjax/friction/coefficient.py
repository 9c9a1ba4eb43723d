"""Unit, meaning and bounds of the coefficients of a model."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np


class Coefficient(NamedTuple):
    """A coefficient of a law, of a spring or of a machine.

    Attributes:
        unit: SI unit, empty for a ratio.
        about: meaning, in a few words.
        lower, upper: bounds of meaningful values; fits stay inside.
        open: whether the lower bound itself is excluded.
        fitted_as: variable of the fit: the "value"; the "logarithm" if the coefficient can range over decades; the
            "inverse root" if the motion depends on it, as on the time in which a stiff contact reverses.

    Examples:
        >>> import fricjax as fj
        >>> slope = fj.friction.Coefficient("N s/m", "viscous coefficient of the contact")
        >>> slope.admits(-0.1), fj.friction.not_negative("", "friction").admits(-0.1)
        (True, False)
    """

    unit: str
    about: str
    lower: float = -math.inf
    upper: float = math.inf
    open: bool = False
    fitted_as: Literal["value", "logarithm", "inverse root"] = "value"

    def admits(self, value: Any) -> bool:
        """Return True if all numbers are within the bounds; NaN never is."""
        above = np.greater if self.open else np.greater_equal
        return bool(np.all(above(value, self.lower) & np.less_equal(value, self.upper)))

    @property
    def demand(self) -> str:
        """Bounds as a predicate: "must not be negative"."""
        of_unit = f" of {self.unit}" if self.unit else ""
        if math.isfinite(self.upper):
            return f"must lie between {self.lower:g} and {self.upper:g}{' ' * bool(self.unit)}{self.unit}"
        if self.open:
            return f"must be a positive number{of_unit}"
        if self.lower == 0:
            return "must not be negative"
        return (
            f"must be at least {self.lower:g}{of_unit}" if math.isfinite(self.lower) else f"must be a number{of_unit}"
        )


def positive(unit: str, about: str) -> Coefficient:
    """Describe a positive coefficient, fitted as its logarithm.

    Args:
        unit: SI unit, empty for a ratio.
        about: meaning, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.positive("m/s", "speed from which on friction grows").demand
        'must be a positive number of m/s'
    """
    return Coefficient(unit, about, 0.0, open=True, fitted_as="logarithm")


def not_negative(unit: str, about: str) -> Coefficient:
    """Describe a coefficient of zero or more.

    Args:
        unit: SI unit, empty for a ratio.
        about: meaning, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.not_negative("", "dynamic coefficient of friction").demand
        'must not be negative'
    """
    return Coefficient(unit, about, 0.0)


def within(lower: float, upper: float, unit: str, about: str) -> Coefficient:
    """Describe a coefficient between two bounds, both included.

    Args:
        lower: smallest value, in `unit`.
        upper: largest value, in `unit`.
        unit: SI unit, empty for a ratio.
        about: meaning, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.within(0.5, 2.0, "", "exponent of the speed").demand
        'must lie between 0.5 and 2'
    """
    return Coefficient(unit, about, lower, upper)


def fraction(about: str) -> Coefficient:
    """Describe a fraction between zero and one, both excluded.

    Args:
        about: meaning, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.fraction("share of the bristles that stick").admits(1.0)
        False
    """
    return Coefficient("", about, 0.0, math.nextafter(1.0, 0.0), open=True)


MU = not_negative("", "dynamic coefficient of friction")
MU_BRISTLE = MU._replace(open=True)  # with mu = 0 bristles have no steady deflection
MU_S = not_negative("", "static coefficient of friction")
V_STRIBECK = positive("m/s", "speed over which friction falls from static to dynamic")
SIGMA0 = positive("N/m", "stiffness of the contact before it slides")._replace(fitted_as="inverse root")
SIGMA1 = not_negative("N s/m", "damping of the contact before it slides")
SIGMA2 = Coefficient("N s/m", "viscous coefficient of the contact")


def is_known(*values: Any) -> bool:
    """Return True if all values are numbers, neither None nor traced."""
    return all(isinstance(value, np.ndarray) for value in values)


def check_coefficients(owner: Any, coefficients: Mapping[str, Coefficient], suffix: str = "") -> None:
    """Refuse coefficients that are out of bounds or not described.

    Absent and traced coefficients are not checked.

    Args:
        owner: object with the coefficients as attributes, each a number or a tuple of numbers.
        coefficients: description of each coefficient.
        suffix: text after the name of a coefficient in a message, such as " of Stribeck".

    Raises:
        ValueError: a coefficient is out of bounds; the message gives its name, its value and the bound.
        TypeError: a numerical field of `owner` has no description; the message says how to add one.
    """
    for field in dataclasses.fields(owner):
        numbers = [value for _, value in _named(field.name, getattr(owner, field.name))]
        if field.name not in coefficients and any(is_known(value) for value in numbers):
            raise TypeError(
                f"{type(owner).__name__} does not describe its coefficient {field.name}: "
                "add Coefficient(unit, about) for it to `coefficients` of the class."
            )
    for listed, coefficient in coefficients.items():
        for name, value in _named(listed, getattr(owner, listed)):
            if is_known(value) and not coefficient.admits(value):
                unit = f" {coefficient.unit}" if coefficient.unit and not coefficient.open else ""
                raise ValueError(f"{name}{suffix} {coefficient.demand}, got {value}{unit}.")


def _named(name: str, value: Any) -> list[tuple[str, Any]]:
    """List names and values; a tuple gives names such as ``forces_3``."""
    return [(f"{name}_{i}", v) for i, v in enumerate(value)] if isinstance(value, tuple) else [(name, value)]


def check_order(owner: Any, lesser: str, greater: str, *, strict: bool = False) -> None:
    """Refuse coefficients in the wrong order.

    Raises:
        ValueError: the order is wrong; the message gives both names and values.
    """
    low, high = getattr(owner, lesser), getattr(owner, greater)
    if is_known(low, high) and not np.all(high > low if strict else high >= low):
        relation = "above" if strict else "at least"
        raise ValueError(f"{greater} of {type(owner).__name__} must be {relation} {lesser} = {low}, got {high}.")
