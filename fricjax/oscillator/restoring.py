"""Restoring forces: what pulls the mass back to its equilibrium.

Each is an odd function ``R(x)`` that rises through zero with the slope of the oscillator's stiffness ``k``.
"""

import abc
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractClassVar

from ..friction.base import Scalar, Values, scalar
from ..friction.coefficient import Coefficient


class AbstractRestoring(eqx.Module):
    """A conservative force ``R(x)`` [N] with its potential energy [J]; `stiffness` is the slope at ``x = 0`` [N/m]."""

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]

    @abc.abstractmethod
    def force(self, x: Values, stiffness: Scalar) -> Values:
        """Restoring force [N], positive where it pulls towards negative x."""

    @abc.abstractmethod
    def potential(self, x: Values, stiffness: Scalar) -> Values:
        """Potential energy [J], zero at the equilibrium."""


class Linear(AbstractRestoring):
    """A linear spring, ``R = k x``."""

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x**2 / 2


class Cubic(AbstractRestoring):
    """A spring that stiffens (k3 > 0) or softens with deflection, ``R = k x + k3 x^3``.

    Attributes:
        k3: cubic coefficient [N/m^3].
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"k3": Coefficient("N/m^3", "cubic coefficient of the spring")}

    k3: Scalar = eqx.field(converter=scalar)

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return (stiffness + self.k3 * x**2) * x

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return (stiffness / 2 + self.k3 * x**2 / 4) * x**2


class Pendulum(AbstractRestoring):
    """A physical pendulum, ``R = k sin x``: x is the angle from hanging [rad] and k the product m g l [N m/rad]."""

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * jnp.sin(x)

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return 2 * stiffness * jnp.sin(x / 2) ** 2
