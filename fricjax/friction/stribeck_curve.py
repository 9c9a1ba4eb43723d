"""Laws with a Stribeck curve (Stribeck, 1902).

The force of steady sliding falls from its static to its dynamic value.
"""

import abc
from collections.abc import Mapping

import jax.numpy as jnp
from equinox import AbstractVar

from .base import UNSCALED, Scalar, Values
from .coefficient import MU_BRISTLE, MU_S, SIGMA2, V_STRIBECK, Coefficient, check_order
from .kinds import AbstractBristle, AbstractSetValued

STRIBECK_CURVE: Mapping[str, Coefficient] = {
    "mu": MU_BRISTLE,
    "mu_s": MU_S,
    "v_stribeck": V_STRIBECK,
    "sigma2": SIGMA2,
}


class AbstractFalling(AbstractSetValued):
    """A set-valued law with a Stribeck curve.

    ``F = N [mu + (mu_s - mu) s(|v|)] sgn(v)``, with a function ``s`` that falls from one to zero. The final classes
    define ``s``.
    """

    mu: AbstractVar[Scalar]
    mu_s: AbstractVar[Scalar | None]
    v_stribeck: AbstractVar[Scalar]

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    @abc.abstractmethod
    def remaining(self, speed: Values) -> Values:
        """Function s [1] at `speed` >= 0 [m/s]."""

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        static = self.mu if self.mu_s is None else self.mu_s
        return load * (self.mu + (static - self.mu) * self.remaining(speed))

    def static_force(self, load: Scalar) -> Scalar:
        return (self.mu if self.mu_s is None else self.mu_s) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return self.v_stribeck


class AbstractStribeckCurve(AbstractBristle):
    """A bristle law with a Stribeck curve.

    The force of steady sliding is ``g(v) + sigma2 v`` with ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]``.
    """

    mu: AbstractVar[Scalar]
    mu_s: AbstractVar[Scalar | None]
    v_stribeck: AbstractVar[Scalar]
    sigma2: AbstractVar[Scalar]

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    def limit(self, speed: Values, load: Scalar) -> Values:
        """Force of steady sliding without the viscous part, g [N]."""
        if self.mu_s is None:
            return self.mu * load * jnp.ones_like(speed)
        return load * (self.mu + (self.mu_s - self.mu) * jnp.exp(-((speed / self.v_stribeck) ** 2)))

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.limit(speed, load) + self.sigma2 * speed

    def static_force(self, load: Scalar) -> Scalar:
        return (self.mu if self.mu_s is None else self.mu_s) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return UNSCALED if self.mu_s is None else self.v_stribeck
