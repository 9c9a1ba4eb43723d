"""Windage: the drag of the surrounding air, quadratic in the velocity."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import AbstractResistance, Scalar, State, Values, scalar
from .coefficient import Coefficient


class Windage(AbstractResistance):
    """``F = windage v|v|``, to be added to a contact law: ``Coulomb(0.01) + Windage(7e-3)``.

    The oscillator's own `drag` is the same force; a model has one of the two.

    Attributes:
        windage: coefficient [N s^2/m^2].
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"windage": Coefficient("N s^2/m^2", "quadratic drag")}
    source: ClassVar[str] = "Newton's law of resistance, c = rho C_d A/2"
    identifies: ClassVar[str] = "windage apart from mu and damping by its growth with the square of the amplitude."

    windage: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.windage * v * jnp.abs(v)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.windage * speed**2
