"""The kinds of laws: set-valued, smooth, and with bristles; what the laws of one kind have in common."""

from typing import ClassVar

import jax.numpy as jnp

from .base import AbstractFriction, Scalar, State, Values


class AbstractMemoryless(AbstractFriction):
    """A law without internal states: the force is a function of velocity and load alone."""

    n_states: ClassVar[int] = 0

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return jnp.zeros(0)

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.zeros(0)

    def state_scale(self, load: Scalar) -> State:
        return jnp.zeros(0)


class AbstractBristle(AbstractFriction):
    """A law with internal states, by whose deflection it holds the mass at rest.

    Examples:
        >>> from fricjax.friction import Dahl
        >>> isinstance(Dahl(0.2, 1e5), AbstractBristle), Dahl(0.2, 1e5).n_states
        (True, 1)
    """

    set_valued: ClassVar[bool] = False


class AbstractSetValued(AbstractMemoryless):
    """A memoryless law with a jump at rest; its zero-velocity limit is at most its static force.

    Examples:
        >>> from fricjax.friction import Stribeck
        >>> isinstance(Stribeck(0.2, 0.25), AbstractSetValued), Stribeck(0.2, 0.25).kind
        (True, 'set-valued')
    """

    set_valued: ClassVar[bool] = True

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return jnp.sign(v) * self.sliding_force(jnp.abs(v), load)

    def static_force(self, load: Scalar) -> Scalar:
        return self.sliding_force(jnp.zeros(()), load)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.sliding_force(jnp.zeros(()), load)


class AbstractConstant(AbstractSetValued):
    """A set-valued law whose force does not depend on how fast the mass slides."""

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)


class AbstractSmooth(AbstractMemoryless):
    """A memoryless law without a jump: it holds nothing at rest.

    Examples:
        >>> from fricjax.friction import Tanh
        >>> isinstance(Tanh(0.2, 1e-4), AbstractSmooth), Tanh(0.2, 1e-4).kind
        (True, 'smooth')
    """

    set_valued: ClassVar[bool] = False

    def static_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)


class AbstractResistance(AbstractSmooth):
    """What grows with the speed from zero, such as drag: a summand that neither holds nor stops the mass."""

    def dynamic_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)

    @property
    def stiff(self) -> bool:
        return False
