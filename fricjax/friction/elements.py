"""Elements that stick and slip: springs in parallel, each of them held by a slider that yields at a force of its own.

The internal state of an element is the deflection of its spring. While it sticks, the deflection follows the
displacement of the mass; once its slider yields, the deflection stays at its limit. Such a play operator is a return
map: over a movement in one direction the deflection is the trial ``z + displacement``, cut off at the limit. So the
trial deflections are what is integrated, whose rate is just the velocity; the force is read off the cut ones, and at
the end of each step the trial is returned to what the slider holds. No step can carry a deflection past its limit.
"""

import abc
from collections.abc import Mapping

import jax.numpy as jnp
from equinox import AbstractVar

from .base import Scalar, State, Values
from .coefficient import Coefficient, fraction, is_known, positive
from .kinds import AbstractBristle
from .stribeck_curve import STRIBECK_CURVE, AbstractStribeckCurve

# A slipping element is left this much beyond its limit, so that it does not seem to stick again by rounding.
BEYOND = 1 + 1e-9


def yielded(trial: Values, limits: Values) -> Values:
    """Deflections that the sliders allow, from trial ones."""
    # Less than half of what clip compiles to, whose derivatives share ties between both sides.
    return jnp.where(trial > limits, limits, jnp.where(trial < -limits, -limits, trial))


class AbstractElements(AbstractBristle):
    """Elements that yield at fixed deflections, whatever the speed: rate-independent friction (Iwan 1966)."""

    @abc.abstractmethod
    def springs(self) -> Values:
        """Stiffness of each element [N/m], shape (elements,)."""

    @abc.abstractmethod
    def sliders(self) -> Values:
        """Force at which each element yields, per newton of load [1], shape (elements,)."""

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
    """Elements of which each carries its share of the Stribeck curve g.

    The shares sum to one, so that the last element has what the others leave.
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
        """Share of each element, the last one included, shape (elements,)."""
        first = jnp.asarray(self.shares, float)
        return jnp.append(first, 1 - jnp.sum(first))

    @property
    def has_fading_memory(self) -> bool:
        return False
