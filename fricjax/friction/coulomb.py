"""Coulomb friction: a constant force against the motion, and a static force that may be larger (Coulomb, 1785)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import AbstractSetValued, Scalar, Values, scalar


class Coulomb(AbstractSetValued):
    """``F = mu N sgn(v)`` while sliding; at rest anything up to ``mu_s N``.

    The static coefficient decides only whether the mass moves on from a reversal. A trace therefore has no gradient
    with respect to it: it is bracketed from stops and non-stops, never fitted.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; a value below `mu` counts as `mu`, and None ties it to `mu`.
    """

    units: ClassVar[Mapping[str, str]] = {"mu": "", "mu_s": ""}

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.mu * load * jnp.ones_like(speed)

    def static_force(self, load: Scalar) -> Scalar:
        return (self.mu if self.mu_s is None else jnp.maximum(self.mu, self.mu_s)) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return jnp.asarray(jnp.inf)
