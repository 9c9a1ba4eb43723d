"""Elements that stick and slip.

An element is a spring in series with a slider. The elements are in parallel, and each yields at a different force. The
internal state of an element is the deflection of its spring. While the element sticks, the deflection follows the
displacement of the mass. After its slider has yielded, the deflection remains at its limit.

This play operator is a return map: over a movement in one direction the deflection is the trial ``z + displacement``,
clipped at the limit. The integrator advances the trial deflections, with the velocity as their rate. The force follows
from the clipped deflections. At the end of each step the trial deflections are clipped, so no step can move a
deflection past its limit.
"""

import abc
from collections.abc import Mapping

import jax.numpy as jnp
from equinox import AbstractVar

from .base import Scalar, State, Values
from .coefficient import Coefficient, fraction, is_known, positive
from .kinds import AbstractBristle
from .stribeck_curve import STRIBECK_CURVE, AbstractStribeckCurve

# A slipping element stays this far beyond its limit, so that rounding does not make it appear to stick.
BEYOND = 1 + 1e-9


def yielded(trial: Values, limits: Values) -> Values:
    """Clip trial deflections at the limits of the sliders."""
    # This compiles to less than half the code of jnp.clip, which shares the derivative at a tie between both sides.
    return jnp.where(trial > limits, limits, jnp.where(trial < -limits, -limits, trial))


class AbstractElements(AbstractBristle):
    """Elements that yield at fixed deflections (Iwan, 1966).

    The friction does not depend on the speed.
    """

    @abc.abstractmethod
    def springs(self) -> Values:
        """Stiffness of each element [N/m], shape (elements,)."""

    @abc.abstractmethod
    def sliders(self) -> Values:
        """Yield force of each element per load [1], shape (elements,)."""

    def limits_of_deflection(self, load: Scalar) -> Values:
        """Deflection at which each element yields [m], shape (elements,)."""
        return self.sliders() * load / self.springs()

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return v * jnp.ones_like(state)

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        return yielded(state, BEYOND * self.limits_of_deflection(load))

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return jnp.sum(self.springs() * yielded(state, self.limits_of_deflection(load))) + jnp.zeros_like(v)

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        return self.limits_of_deflection(load) - jnp.sign(v) * state

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return BEYOND * direction * self.limits_of_deflection(load)

    def state_scale(self, load: Scalar) -> State:
        return self.limits_of_deflection(load)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)

    def static_force(self, load: Scalar) -> Scalar:
        return self.dynamic_force(load)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return jnp.sum(self.sliders()) * load

    @property
    def stiff(self) -> bool:
        return False

    @property
    def has_fading_memory(self) -> bool:
        return False


STRIBECK_ELEMENTS: Mapping[str, Coefficient] = {
    **STRIBECK_CURVE,
    "stiffnesses": positive("N/m", "stiffness of an element"),
    "shares": fraction("share of an element in the force of steady sliding"),
}


class AbstractStribeckElements(AbstractStribeckCurve):
    """Elements that share the force g of the Stribeck curve.

    The shares sum to one; the last element has the remaining share.
    """

    stiffnesses: AbstractVar[tuple[Scalar, ...]]
    shares: AbstractVar[tuple[Scalar, ...]]

    def __check_init__(self) -> None:
        name, expected = type(self).__name__, len(self.stiffnesses) - 1
        if len(self.shares) != expected or expected < 0:
            raise ValueError(
                f"{name} needs a stiffness for each element and a share for each but the last, which has the rest, got "
                f"{len(self.stiffnesses)} stiffnesses and {len(self.shares)} shares."
            )
        if is_known(*self.shares) and not sum(self.shares) < 1:
            raise ValueError(
                f"shares of {name} must leave something to the last element, got a sum of {sum(self.shares)}."
            )

    def springs(self) -> Values:
        """Stiffness of each element [N/m], shape (elements,)."""
        return jnp.stack([jnp.asarray(k) for k in self.stiffnesses])

    def all_shares(self) -> Values:
        """Share of each element, including the last one, shape (elements,)."""
        first = jnp.asarray(self.shares, float)
        return jnp.append(first, 1 - jnp.sum(first))

    @property
    def has_fading_memory(self) -> bool:
        return False
