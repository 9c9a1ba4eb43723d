"""Restoring forces of the oscillator.

Each force is an odd function ``R(x)`` with slope ``k``, the oscillator's stiffness, at zero. A spring may also resist
every motion by internal friction that grows with its deflection.
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

# Steps of the arithmetic-geometric mean. Each step first takes the square root of the ratio and later squares the
# relative difference; eight reach rounding error from a ratio of a million.
_MEANS = 8


class AbstractRestoring(eqx.Module):
    """Conservative force ``R(x)`` [N] with its potential energy [J].

    `stiffness` is always the slope at ``x = 0`` [N/m]. The engines work in a transformed coordinate `q`, in which the
    spring is nearly linear, see :meth:`stretched`.

    Attributes:
        hysteretic: whether the spring also has internal friction; that force has a kink at the equilibrium.
        stiffens: whether the force may grow faster than the deflection.
        largest: largest deflection from which the spring still pulls back [m].
    """

    coefficients: AbstractClassVar[Mapping[str, Coefficient]]
    hysteretic: ClassVar[bool] = False
    stiffens: ClassVar[bool] = False
    largest: ClassVar[float] = float("inf")

    def __check_init__(self) -> None:
        check_coefficients(self, self.coefficients, f" of {type(self).__name__}")

    @abc.abstractmethod
    def force(self, x: Values, stiffness: Scalar) -> Values:
        """Return the restoring force [N], positive if it pulls towards negative x."""

    @abc.abstractmethod
    def potential(self, x: Values, stiffness: Scalar) -> Values:
        """Return the potential energy [J], zero at the equilibrium."""

    def hysteresis(self, x: Values, stiffness: Scalar) -> Values:
        """Return the internal friction force [N], not negative.

        It opposes the motion in both directions.
        """
        return 0.0 * x

    def reference(self, x: Values, stiffness: Scalar) -> Values:
        """Return the stiffness of the equivalent linear spring for half-cycles from `x`.

        The default is the secant stiffness.
        """
        away = jnp.abs(x) > 0
        x = jnp.where(away, x, 1.0)
        return jnp.where(away, self.force(x, stiffness) / x, stiffness)

    def stretched(self, x: Values) -> Values:
        """Return a coordinate in which half-cycles are nearly harmonic.

        The default is `x`.
        """
        return x

    def unstretched(self, q: Values) -> tuple[Values, Values | float]:
        """Return the displacement at coordinate `q`, and dq/dx there."""
        return q, 1.0

    def remainder(self, x: Values, reference: Values, stiffness: Scalar) -> Values | float:
        """Return the force in excess of the equivalent spring [N].

        It is ``R - k_ref q dq/dx``.
        """
        return self.force(x, stiffness) - reference * x

    def steepened(self, x: Values) -> Values:
        """Return the stretched coordinate over its slope, unbounded where the slope vanishes."""
        return x

    def unsteepened(self, ratio: Values) -> Values:
        """Invert :meth:`steepened`: return the displacement."""
        return ratio

    def spread(self, ratio: Values) -> Values:
        """Return the table coordinate of a :meth:`steepened` value.

        It rises with the value, and half-cycles are smooth functions of it.
        """
        return _module(ratio).log(ratio)

    def gathered(self, place: Values) -> Values:
        """Invert :meth:`spread`."""
        return jnp.exp(place)


class Linear(AbstractRestoring):
    """Linear spring, ``R = k x``."""

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}

    def force(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x

    def potential(self, x: Values, stiffness: Scalar) -> Values:
        return stiffness * x**2 / 2


class Cubic(AbstractRestoring):
    """Spring with a cubic term, ``R = k x + k3 x^3``.

    It stiffens for k3 > 0 and softens for k3 < 0.

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
    """Physical pendulum, ``R = k sin x``.

    x is the angle from hanging [rad] and k the product m g l [N m/rad]. In ``q = 2 sin(x/2)`` the energy is that of a
    linear spring. Without losses ``q = Q cos(theta)``, and only the time ``dt/dtheta = 1/(omega cos(x/2))`` is an
    elliptic integral (Jacobi's amplitude).
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {}
    # A milliradian below the top; no decay record starts above it.
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
        """Return the logarithm of ``K(m)/K(1 - m)``.

        This is the ratio of the half-period in real time to that in imaginary time. A half-cycle is singular if the
        modulus m is 0, 1 or infinite: at zero, at the largest, and at an imaginary deflection of 2i. As a function of
        the complex ratio all singularities lie on the imaginary axis, so a small table covers amplitudes from the dead
        band to the top.
        """
        return _log_ratio(ratio) if isinstance(ratio, jax.Array) else np.log(np.divide(*_means(ratio)))

    def gathered(self, place: Values) -> Values:
        # Reciprocal ratios belong to reciprocal tangents.
        nome = jnp.exp(-jnp.pi * jnp.exp(jnp.abs(place)))
        second = 2 * nome**0.25 * (1 + nome**2 + nome**6)
        fourth = 1 - 2 * nome + 2 * nome**4 - 2 * nome**9
        tangent = (second / fourth) ** 2
        return 2 * jnp.where(place < 0, tangent, 1 / tangent)


def _module(values: Values) -> Any:
    """Return NumPy for host values, otherwise jax.numpy.

    JAX operations on host values cost more than their arithmetic.
    """
    return jnp if isinstance(values, jax.Array) else np


def _means(ratio: Values) -> tuple[Any, Any]:
    """Return K and K' up to a common factor by arithmetic-geometric means."""
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
    """Differentiate by Legendre's relation ``d(K/K')/dm = pi/(4 m (1 - m) K'^2)``.

    This avoids differentiating the iterations.
    """
    (ratio,), (change,) = primals, tangents
    real, imaginary = _means(ratio)
    slope = 2 / (jnp.pi * ratio * (1 + ratio**2 / 4) * real * imaginary)
    return jnp.log(real / imaginary), slope * change


class Structural(AbstractRestoring):
    """Spring with rate-independent internal loss, ``k x + eta_h k |x| sgn(v)``.

    See Reid (1956). The stiffness is ``k (1 + eta_h)`` on the way out and ``k (1 - eta_h)`` on the way in. Without
    other losses, successive turning points have the ratio ``sqrt((1 - eta_h)/(1 + eta_h))``. This constant logarithmic
    decrement cannot be separated from viscous damping in a decay at one frequency. The loss factor is ``2 eta_h/pi``.

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
