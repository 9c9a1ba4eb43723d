"""Base classes for the kinds of laws: set-valued, smooth, and bristle laws."""

import abc
from typing import ClassVar

import jax.numpy as jnp

from .base import AbstractFriction, Scalar, State, Values


class AbstractMemoryless(AbstractFriction):
    """A law without internal states.

    Its force depends only on velocity and load.
    """

    n_states: ClassVar[int] = 0

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return jnp.zeros(0)

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.zeros(0)

    def state_scale(self, load: Scalar) -> State:
        return jnp.zeros(0)


class AbstractBristle(AbstractFriction):
    """A law with internal states.

    The deflection of the contact holds the mass at rest.

    Examples:
        >>> from fricjax.friction import Dahl
        >>> isinstance(Dahl(0.2, 1e5), AbstractBristle), Dahl(0.2, 1e5).n_states
        (True, 1)
    """

    set_valued: ClassVar[bool] = False


class AbstractSetValued(AbstractMemoryless):
    """A law without internal states that jumps at zero velocity.

    The limit of its sliding force at zero velocity is at most the static force.

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
    """A set-valued law with a force that does not depend on speed."""

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)


class AbstractSmooth(AbstractMemoryless):
    """A law without internal states and without a jump.

    It does not hold the mass at rest.

    Examples:
        >>> from fricjax.friction import Tanh
        >>> isinstance(Tanh(0.2, 1e-4), AbstractSmooth), Tanh(0.2, 1e-4).kind
        (True, 'smooth')
    """

    set_valued: ClassVar[bool] = False

    def static_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)


class AbstractResistance(AbstractSmooth):
    """A force that grows with the speed from zero, such as drag.

    It is a summand of other laws, because it neither holds nor stops the mass.
    """

    def dynamic_force(self, load: Scalar) -> Scalar:
        return jnp.zeros_like(load)

    @property
    def stiff(self) -> bool:
        return False


class AbstractDeflection(AbstractBristle):
    """A law with one internal state, the deflection of the contact.

    ``F = mu N z/l`` with the deflection `z` [m] between ``-l`` and ``l``.

    Such a contact is a yielding spring. It has its full stiffness at first and tends to a steady deflection at which it
    slides. The deflection depends only on the path and not on the speed along it.
    """

    n_states: ClassVar[int] = 1

    @abc.abstractmethod
    def settling_length(self, load: Scalar) -> Scalar:
        """Deflection l of steady sliding [m].

        It is also the travel over which the force reaches its steady value.
        """

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
