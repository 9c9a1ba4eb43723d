"""Restoring forces: what pulls the mass back to its equilibrium.

Each is an odd function ``R(x)`` that rises through zero with the slope of the oscillator's stiffness ``k``. A spring
may also resist every motion by an internal friction that grows with its deflection.
"""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from equinox import AbstractClassVar

from ..friction.base import Scalar, Values, scalar
from ..friction.coefficient import Coefficient, check_coefficients, within

# Steps of an arithmetic-geometric mean. Each takes the ratio of both numbers to its root and, once they are near,
# squares their difference: rounding is reached from a ratio of a million.
_MEANS = 8


class AbstractRestoring(eqx.Module):
    """A conservative force ``R(x)`` [N] with its potential energy [J]; `stiffness` is the slope at ``x = 0`` [N/m].

    Attributes:
        hysteretic: whether the spring resists motion besides; that force has a kink at the equilibrium.
        stiffens: whether it may pull harder at some deflection than in proportion to it.
        largest: the largest deflection from which it still pulls back [m].
    """

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]
    hysteretic: ClassVar[bool] = False
    stiffens: ClassVar[bool] = False
    largest: ClassVar[float] = float("inf")

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

    def reference(self, x: Values, stiffness: Scalar) -> Values:
        """Stiffness of the linear spring that stands for this one in half-cycles from `x`; by default the secant."""
        away = jnp.abs(x) > 0
        x = jnp.where(away, x, 1.0)
        return jnp.where(away, self.force(x, stiffness) / x, stiffness)

    def stretched(self, x: Values) -> Values:
        """Coordinate in which the half-cycles are swings of a linear spring, or nearly so; by default `x` itself."""
        return x

    def unstretched(self, q: Values) -> tuple[Values, Values | float]:
        """Displacement at that coordinate, and the slope of the coordinate over the displacement there."""
        return q, 1.0

    def remainder(self, x: Values, reference: Values, stiffness: Scalar) -> Values | float:
        """What the force is besides that of the spring that stands for it, ``R - k_ref q dq/dx`` [N]."""
        return self.force(x, stiffness) - reference * x

    def steepened(self, x: Values) -> Values:
        """The stretched coordinate over its slope, which has no bound where that vanishes."""
        return x

    def unsteepened(self, ratio: Values) -> Values:
        """Displacement from what :meth:`steepened` gives."""
        return ratio

    def spread(self, ratio: Values) -> Values:
        """Coordinate of a table over what :meth:`steepened` gives, rising; half-cycles are smooth in it."""
        return _module(ratio).log(ratio)

    def gathered(self, place: Values) -> Values:
        """The inverse of :meth:`spread`."""
        return jnp.exp(place)


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
    """A physical pendulum, ``R = k sin x``: x is the angle from hanging [rad] and k the product m g l [N m/rad].

    In ``q = 2 sin(x/2)`` its energy is that of a linear spring, so that without losses ``q = Q cos(theta)`` and only
    the lapse of time ``dt/dtheta = 1/(omega cos(x/2))`` is that of an elliptic integral (Jacobi's amplitude).
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}
    # A milliradian below the top, where no record that shows a decay begins.
    largest: ClassVar[float] = float(np.pi) - 1e-3

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * jnp.sin(x)

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return 2 * stiffness * jnp.sin(x / 2) ** 2

    def reference(self, x: Values, stiffness: Scalar) -> Values:
        return jnp.broadcast_to(stiffness, jnp.shape(x))

    def stretched(self, x: Values) -> Values:
        return 2 * jnp.sin(x / 2)

    def unstretched(self, q: Values) -> tuple[Values, Values | float]:
        return 2 * jnp.arcsin(q / 2), jnp.sqrt((1 - q / 2) * (1 + q / 2))

    def remainder(self, x: Values, reference: Values, stiffness: Scalar) -> Values | float:
        return 0.0

    def steepened(self, x: Values) -> Values:
        return 2 * _module(x).tan(x / 2)

    def unsteepened(self, ratio: Values) -> Values:
        return 2 * _module(ratio).arctan(ratio / 2)

    def spread(self, ratio: Values) -> Values:
        """Logarithm of ``K(m)/K(1 - m)``, the half-period in real time over that in imaginary time.

        A half-cycle has its singularities where the modulus m is 0, 1 or infinite: at no, at the largest and at an
        imaginary deflection of 2 i. In this ratio, as a complex number, they all lie on the imaginary axis, so that few
        entries of a table do for amplitudes from the dead band to the top.
        """
        return _log_ratio(ratio) if isinstance(ratio, jax.Array) else np.log(np.divide(*_means(ratio)))

    def gathered(self, place: Values) -> Values:
        # The ratio and its inverse belong to tangents that are inverse to each other.
        nome = jnp.exp(-jnp.pi * jnp.exp(jnp.abs(place)))
        second = 2 * nome**0.25 * (1 + nome**2 + nome**6)
        fourth = 1 - 2 * nome + 2 * nome**4 - 2 * nome**9
        tangent = (second / fourth) ** 2
        return 2 * jnp.where(place < 0, tangent, 1 / tangent)


def _module(values: Values) -> Any:
    """NumPy for what is on the host, where each operation of JAX costs more than the arithmetic in it."""
    return jnp if isinstance(values, jax.Array) else np


def _means(ratio: Values) -> tuple[Any, Any]:
    """K and K' of a pendulum, both over a common factor: the reciprocals of arithmetic-geometric means."""
    xp = _module(ratio)
    long = xp.sqrt(1 + ratio**2 / 4)
    return 1 / _mean(long, xp.ones_like(ratio)), 1 / _mean(long, ratio / 2)


def _mean(a: Any, b: Any) -> Any:
    for _ in range(_MEANS):
        a, b = (a + b) / 2, _module(a).sqrt(a * b)
    return a


@jax.custom_jvp
def _log_ratio(ratio: Any) -> Any:
    real, imaginary = _means(ratio)
    return jnp.log(real / imaginary)


@_log_ratio.defjvp
def _log_ratio_jvp(primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
    """By Legendre's relation ``d(K/K')/dm = pi/(4 m (1 - m) K'^2)``, so that the steps of the means have none."""
    (ratio,), (change,) = primals, tangents
    real, imaginary = _means(ratio)
    slope = 2 / (jnp.pi * ratio * (1 + ratio**2 / 4) * real * imaginary)
    return jnp.log(real / imaginary), slope * change


class Structural(AbstractRestoring):
    """A linear spring whose material loses energy at any speed: ``k x + eta_h k |x| sgn(v)`` (Reid, 1956).

    The stiffness is ``k (1 + eta_h)`` on the way out and ``k (1 - eta_h)`` on the way in, so that without other losses
    successive turning points have the ratio ``sqrt((1 - eta_h)/(1 + eta_h))``: a constant logarithmic decrement, which
    in a decay at one frequency cannot be separated from viscous damping. The loss factor is ``2 eta_h/pi``.

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
