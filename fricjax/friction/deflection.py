"""Bristle laws with one internal state, the deflection of the contact, to which the force is proportional.

Such a contact is a spring that yields: it begins to move with its full stiffness, and tends to a steady deflection
at which it slides. How it gets there depends on the path alone and not on how fast the path is travelled.
"""

import abc
from typing import ClassVar

import jax.numpy as jnp

from .base import Scalar, State, Values
from .kinds import AbstractBristle


class AbstractDeflection(AbstractBristle):
    """``F = mu N z/l``, with the deflection `z` [m] between ``-l`` and ``l``."""

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
