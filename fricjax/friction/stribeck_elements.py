"""What laws of elements under a force of steady sliding that falls with speed have in common."""

from collections.abc import Mapping

import jax.numpy as jnp
from equinox import AbstractVar

from .base import AbstractBristle, Scalar, Values
from .coefficient import MU_BRISTLE, MU_S, SIGMA2, V_STRIBECK, Coefficient, check_order, fraction, is_known, positive

STRIBECK_ELEMENTS: Mapping[str, Coefficient] = {
    "mu": MU_BRISTLE,
    "mu_s": MU_S,
    "v_stribeck": V_STRIBECK,
    "stiffnesses": positive("N/m", "stiffness of an element"),
    "shares": fraction("share of an element in the force of steady sliding"),
    "sigma2": SIGMA2,
}


class AbstractStribeckElements(AbstractBristle):
    """Elements of which each carries its share of ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]``.

    The shares sum to one, so that the last element has what the others leave.
    """

    mu: AbstractVar[Scalar]
    mu_s: AbstractVar[Scalar | None]
    v_stribeck: AbstractVar[Scalar]
    stiffnesses: AbstractVar[tuple[Scalar, ...]]
    shares: AbstractVar[tuple[Scalar, ...]]
    sigma2: AbstractVar[Scalar]

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")
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

    def limit(self, speed: Values, load: Scalar) -> Values:
        """Force of steady sliding without the viscous part [N]."""
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
        return jnp.asarray(jnp.inf) if self.mu_s is None else self.v_stribeck
