"""Rate-and-state friction.

The contact is stronger at lower speed and at higher age. The laws come from rock mechanics (Dieterich 1979, Ruina
1983), here in the form that is regular at rest (Rice, Lapusta and Ranjith, 2001). They have no static friction: the
contact creeps under any force, more slowly by a factor e for each ``a N`` by which the force is below ``mu N``.
"""

import abc
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from equinox import AbstractVar

from .base import Scalar, State, Values, scalar
from .coefficient import MU, Coefficient, not_negative, positive
from .kinds import AbstractBristle

_STEEPEST = 300.0  # the square of its exponential does not overflow
_TINY = 1e-300
_SLOWEST = 2e-9  # slowest steady sliding over v_reference; with 1 um/s and 10 um the age of the contact is 150 years

RATE_STATE: Mapping[str, Coefficient] = {
    "mu": MU._replace(about="coefficient of friction of steady sliding at v_reference"),
    "a": positive("", "direct effect: rise of the coefficient per e-fold of velocity"),
    "b": not_negative("", "evolution effect: rise of the coefficient per e-fold of age"),
    "slip_distance": positive("m", "travel over which contacts are renewed"),
    "v_reference": positive("m/s", "velocity to which mu refers"),
}
REGULAR = "regular at rest: J. R. Rice et al., J. Mech. Phys. Solids 49 (2001)"
IDENTIFIES = (
    "mu and a - b from half-cycles over a wide range of speeds; a and slip_distance separately from b by the "
    "reversals; v_reference never, because it only states the speed to which mu refers."
)


@jax.custom_jvp
def arsinh_of_product(ratio: Values, exponent: Values) -> Values:
    """Compute ``arsinh(ratio exp(exponent))`` without overflow of the exponential."""
    size, bend = jnp.abs(ratio), jnp.exp(-exponent)
    larger = jnp.maximum(jnp.maximum(size, bend), _TINY)
    share = jnp.minimum(size, bend) / larger
    root = jnp.sqrt(1 + share**2)
    linear = jnp.log1p(share + share**2 / (1 + root))
    return jnp.sign(ratio) * jnp.where(size < bend, linear, jnp.log(larger * (1 + root)) + exponent)


@arsinh_of_product.defjvp
def _slopes(at: tuple[Values, Values], along: tuple[Values, Values]) -> tuple[Values, Values]:
    (ratio, exponent), (by_ratio, by_exponent) = at, along
    root = jnp.sqrt(ratio**2 + jnp.exp(-2 * jnp.minimum(exponent, _STEEPEST)))
    return arsinh_of_product(ratio, exponent), (by_ratio + ratio * by_exponent) / root


class AbstractRateState(AbstractBristle):
    """Base class of rate-and-state laws.

    ``F = a N arsinh{v/(2 v_reference) exp[(mu + b psi)/a]}`` with the age ``psi = ln(v_reference theta/slip_distance)``
    of the contact and the mean life theta [s] of its junctions. The internal state is ``slip_distance psi`` [m]. Like
    the deflection of a bristle, it approaches its steady value over the length that scales it. Its sign does not depend
    on the direction of motion.
    """

    mu: AbstractVar[Scalar]
    a: AbstractVar[Scalar]
    b: AbstractVar[Scalar]
    slip_distance: AbstractVar[Scalar]
    v_reference: AbstractVar[Scalar]

    n_states: ClassVar[int] = 1

    @abc.abstractmethod
    def ageing(self, speed: Scalar, age: Values) -> Values:
        """Rate of the internal state [m/s] at speed [m/s] and age psi."""

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return self.ageing(jnp.abs(v), state / self.slip_distance)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        strength = (self.mu + self.b * (state[0] / self.slip_distance)) / self.a
        return self.a * load * arsinh_of_product(v / (2 * self.v_reference), strength)

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        ratio = jnp.maximum(jnp.abs(v) / self.v_reference, _SLOWEST)
        return jnp.reshape(-self.slip_distance * jnp.log(ratio), (1,))

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        return jnp.zeros(1)  # steady state of a pull at the reference velocity

    def state_scale(self, load: Scalar) -> State:
        return jnp.reshape(self.slip_distance, (1,))

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        age = -jnp.log(jnp.maximum(speed / self.v_reference, _SLOWEST))
        return self.a * load * arsinh_of_product(speed / (2 * self.v_reference), (self.mu + self.b * age) / self.a)

    def static_force(self, load: Scalar) -> Scalar:
        return self.mu * load  # under this force the contact creeps at the reference velocity

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return self.v_reference

    @property
    def step_refinement(self) -> int:
        # Between half-cycles the contact ages by many e-folds, and the error of a step remains in the motion.
        return 4


class RateState(AbstractRateState):
    """Rate-and-state friction with Dieterich's ageing law.

    ``F = a N arsinh{v/(2 v_reference) exp[(mu + b psi)/a]}`` with ``dtheta/dt = 1 - |v| theta/slip_distance``.

    Here ``psi = ln(v_reference theta/slip_distance)``. The internal state is ``slip_distance psi`` [m]. A contact at
    rest grows older. There is no static friction, so a mass at rest creeps.

    Attributes:
        mu: coefficient of friction of steady sliding at `v_reference` [1]; it changes by a - b per e-fold of velocity.
        a: direct effect [1], typically 0.002 to 0.02.
        b: evolution effect [1]; friction falls with velocity where b > a.
        slip_distance: travel D_c over which contacts are renewed [m], typically 0.5 to 20 um.
        v_reference: velocity to which mu refers [m/s]; keep it fixed in fits.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.RateState(mu=0.2, a=0.01, b=0.015, slip_distance=1e-6, v_reference=1e-3)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.1151, 1.8849], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = RATE_STATE
    source: ClassVar[str] = "J. H. Dieterich, J. Geophys. Res. 84 (1979); " + REGULAR
    identifies: ClassVar[str] = IDENTIFIES

    mu: Scalar = eqx.field(converter=scalar)
    a: Scalar = eqx.field(converter=scalar)
    b: Scalar = eqx.field(converter=scalar)
    slip_distance: Scalar = eqx.field(converter=scalar)
    v_reference: Scalar = eqx.field(converter=scalar, default=1e-6)

    def ageing(self, speed: Scalar, age: Values) -> Values:
        return self.v_reference * jnp.exp(-age) - speed


class RateStateSlip(AbstractRateState):
    """Rate-and-state friction with Ruina's slip law.

    The force is that of :class:`RateState`, and the age follows
    ``dtheta/dt = -(|v| theta/slip_distance) ln(|v| theta/slip_distance)``. A contact changes only while it slides.

    Attributes:
        mu: coefficient of friction of steady sliding at `v_reference` [1]; it changes by a - b per e-fold of velocity.
        a: direct effect [1], typically 0.002 to 0.02.
        b: evolution effect [1]; friction falls with velocity where b > a.
        slip_distance: travel D_c over which contacts are renewed [m], typically 0.5 to 20 um.
        v_reference: velocity to which mu refers [m/s]; keep it fixed in fits.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.RateStateSlip(mu=0.2, a=0.01, b=0.015, slip_distance=1e-6, v_reference=1e-3)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.1151, 1.8849], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = RATE_STATE
    source: ClassVar[str] = "A. Ruina, J. Geophys. Res. 88 (1983); " + REGULAR
    identifies: ClassVar[str] = IDENTIFIES

    mu: Scalar = eqx.field(converter=scalar)
    a: Scalar = eqx.field(converter=scalar)
    b: Scalar = eqx.field(converter=scalar)
    slip_distance: Scalar = eqx.field(converter=scalar)
    v_reference: Scalar = eqx.field(converter=scalar, default=1e-6)

    def ageing(self, speed: Scalar, age: Values) -> Values:
        ratio = speed / self.v_reference
        return -speed * (jnp.log(jnp.where(ratio > 0, ratio, 1.0)) + age)
