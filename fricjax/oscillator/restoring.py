"""Restoring forces: what pulls the mass back to its equilibrium.

Each is an odd function ``R(x)`` that rises through zero with the slope of the oscillator's stiffness ``k``. A spring
may also resist every motion by an internal friction that grows with its deflection.
"""

import abc
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from equinox import AbstractClassVar

from ..friction.base import Scalar, Values, scalar
from ..friction.coefficient import Coefficient, check_coefficients, within


class AbstractRestoring(eqx.Module):
    """A conservative force ``R(x)`` [N] with its potential energy [J]; `stiffness` is the slope at ``x = 0`` [N/m].

    Attributes:
        hysteretic: whether the spring resists motion besides; that force has a kink at the equilibrium.
        stiffens: whether it may pull harder at some deflection than in proportion to it.
    """

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]
    hysteretic: ClassVar[bool] = False
    stiffens: ClassVar[bool] = False

    def __check_init__(self) -> None:
        check_coefficients(self, self.coefficients, f" of {type(self).__name__}")

    @abc.abstractmethod
    def force(self, x: Values, stiffness: Scalar) -> Values:
        """Restoring force [N], positive where it pulls towards negative x."""

    @abc.abstractmethod
    def potential(self, x: Values, stiffness: Scalar) -> Values:
        """Potential energy [J], zero at the equilibrium."""

    def hysteresis(self, x: Values, stiffness: Scalar) -> Values:
        """Force of internal friction [N], not negative; it opposes the motion whatever its direction."""
        return jnp.zeros_like(x)


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
    stiffens: ClassVar[bool] = True

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


class Structural(AbstractRestoring):
    """A linear spring whose material loses energy at any speed: ``k x + eta_h k |x| sgn(v)`` (Reid, 1956).

    The stiffness is ``k (1 + eta_h)`` on the way out and ``k (1 - eta_h)`` on the way in, so that without other losses
    successive turning points have the ratio ``sqrt((1 - eta_h)/(1 + eta_h))``: a constant logarithmic decrement, which
    in a decay at one frequency cannot be told from viscous damping. The loss factor is ``2 eta_h/pi``.

    Attributes:
        eta_h: ratio of the hysteretic to the elastic force [1].
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "eta_h": within(0.0, 0.5, "", "ratio of the hysteretic to the elastic force")
    }
    hysteretic: ClassVar[bool] = True

    eta_h: Scalar = eqx.field(converter=scalar)

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x**2 / 2

    def hysteresis(self, x: Values, stiffness: Scalar) -> Values:
        return self.eta_h * stiffness * jnp.abs(x)
