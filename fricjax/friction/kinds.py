"""The kinds of laws: set-valued, smooth, and with bristles; what the laws of one kind have in common."""

import abc
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


class AbstractDeflection(AbstractBristle):
    """``F = mu N z/l``, with one internal state, the deflection `z` [m] of the contact between ``-l`` and ``l``.

    Such a contact is a spring that yields: it begins to move with its full stiffness, and tends to a steady deflection
    at which it slides. How it gets there depends on the path alone and not on how fast the path is travelled.
    """

    n_states: ClassVar[int] = 1

    @abc.abstractmethod
    def settling_length(self, load: Scalar) -> Scalar:
        """Deflection l of steady sliding [m], which is also the travel over which the force settles."""

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.dynamic_force(load) * (state[0] / self.settling_length(load))

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return direction * self.state_scale(load)

    def state_scale(self, load: Scalar) -> State:
        return jnp.reshape(self.settling_length(load), (1,))

    def reach(self, load: Scalar) -> State:
        return self.state_scale(load)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)

    def static_force(self, load: Scalar) -> Scalar:
        return self.dynamic_force(load)
