"""Coulomb friction with its jump smoothed by a hyperbolic tangent."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import AbstractSmooth, Scalar, State, Values, scalar
from .coulomb import Coulomb


class Tanh(AbstractSmooth):
    """``F = mu N tanh(v/v_s)``.

    The mass never rests: after the last reversal it creeps towards the spring's equilibrium with the time constant
    ``mu N/(k v_s)``. Keep ``v_s`` below the resolution divided by the time that is looked at, or leave the rest out.

    Attributes:
        mu: dynamic coefficient of friction [1].
        v_s: regularisation width [m/s].
    """

    units: ClassVar[Mapping[str, str]] = {"mu": "", "v_s": "m/s"}

    mu: Scalar = eqx.field(converter=scalar)
    v_s: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.mu * load * jnp.tanh(v / self.v_s)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.mu * load * jnp.tanh(speed / self.v_s)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return self.v_s

    def sharp(self) -> Coulomb:
        return Coulomb(self.mu)
