"""What a coefficient of a model is: its unit, its meaning, and the values that it can have."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np


class Coefficient(NamedTuple):
    """A coefficient of a law, of a spring or of a machine.

    Attributes:
        unit: SI unit, empty for a ratio.
        about: what it is, in a few words.
        lower, upper: bounds of the values that mean something; fits stay inside.
        open: whether the lower bound itself is excluded.
        fitted_as: what fits work in: its "value"; its "logarithm" where it may range over decades; its "inverse
            root" where the motion follows that, as it follows the time that a stiff contact takes to turn.

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
        """Whether all of these numbers lie inside of the bounds; NaN never does."""
        above = np.greater if self.open else np.greater_equal
        return bool(np.all(above(value, self.lower) & np.less_equal(value, self.upper)))

    @property
    def demand(self) -> str:
        """The bounds as the end of a sentence that begins with the name."""
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
    """A coefficient above zero that may range over decades, so that fits vary its logarithm.

    Args:
        unit: SI unit, empty for a ratio.
        about: what it is, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.positive("m/s", "speed from which on friction grows").demand
        'must be a positive number of m/s'
    """
    return Coefficient(unit, about, 0.0, open=True, fitted_as="logarithm")


def not_negative(unit: str, about: str) -> Coefficient:
    """A coefficient of zero or more.

    Args:
        unit: SI unit, empty for a ratio.
        about: what it is, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.not_negative("", "dynamic coefficient of friction").demand
        'must not be negative'
    """
    return Coefficient(unit, about, 0.0)


def within(lower: float, upper: float, unit: str, about: str) -> Coefficient:
    """A coefficient between two bounds, which it may reach.

    Args:
        lower: the least value, in `unit`.
        upper: the largest one.
        unit: SI unit, empty for a ratio.
        about: what it is, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.within(0.5, 2.0, "", "exponent of the speed").demand
        'must lie between 0.5 and 2'
    """
    return Coefficient(unit, about, lower, upper)


def fraction(about: str) -> Coefficient:
    """A share between zero and one, of which it reaches neither.

    Args:
        about: what it is, in a few words.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.fraction("share of the bristles that stick").admits(1.0)
        False
    """
    return Coefficient("", about, 0.0, math.nextafter(1.0, 0.0), open=True)


MU = not_negative("", "dynamic coefficient of friction")
MU_BRISTLE = MU._replace(open=True)  # bristles of no strength have no deflection to settle at
MU_S = not_negative("", "static coefficient of friction")
V_STRIBECK = positive("m/s", "speed over which friction falls from static to dynamic")
SIGMA0 = positive("N/m", "stiffness of the contact before it slides")._replace(fitted_as="inverse root")
SIGMA1 = not_negative("N s/m", "damping of the contact before it slides")
SIGMA2 = Coefficient("N s/m", "viscous coefficient of the contact")


def is_known(*values: Any) -> bool:
    """Whether all of these are numbers now, and neither absent nor traced."""
    return all(isinstance(value, np.ndarray) for value in values)


def check_coefficients(owner: Any, coefficients: Mapping[str, Coefficient], whose: str = "") -> None:
    """Refuse coefficients outside of their bounds, and numbers of which nothing is known.

    Those that are absent or traced are not looked at.

    Args:
        owner: what has the coefficients as attributes, each a number or a tuple of numbers.
        coefficients: what is known of each.
        whose: put behind the name of a coefficient, such as " of Stribeck".

    Raises:
        ValueError: names the coefficient, its value and its bound.
        TypeError: a number among the fields of `owner` without an entry; names it and what to add.
    """
    for field in dataclasses.fields(owner):
        numbers = [value for _, value in _named(field.name, getattr(owner, field.name))]
        if field.name not in coefficients and any(is_known(value) for value in numbers):
            raise TypeError(
                f"{type(owner).__name__} has the coefficient {field.name}, of which nothing is known: "
                "add Coefficient(unit, about) for it to `coefficients` of the class."
            )
    for listed, coefficient in coefficients.items():
        for name, value in _named(listed, getattr(owner, listed)):
            if is_known(value) and not coefficient.admits(value):
                unit = f" {coefficient.unit}" if coefficient.unit and not coefficient.open else ""
                raise ValueError(f"{name}{whose} {coefficient.demand}, got {value}{unit}.")


def _named(name: str, value: Any) -> list[tuple[str, Any]]:
    """A coefficient with its name, or each number of a list with its own, as in ``forces_3``."""
    return [(f"{name}_{i}", v) for i, v in enumerate(value)] if isinstance(value, tuple) else [(name, value)]


def check_order(owner: Any, lesser: str, greater: str, *, strict: bool = False) -> None:
    """Refuse coefficients in the wrong order.

    Raises:
        ValueError: names both with their values.
    """
    low, high = getattr(owner, lesser), getattr(owner, greater)
    if is_known(low, high) and not np.all(high > low if strict else high >= low):
        relation = "above" if strict else "at least"
        raise ValueError(f"{greater} of {type(owner).__name__} must be {relation} {lesser} = {low}, got {high}.")
