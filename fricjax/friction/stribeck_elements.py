"""What laws of elements under a force of steady sliding that falls with speed have in common."""

from collections.abc import Mapping

import jax.numpy as jnp
from equinox import AbstractVar

from .base import Scalar, Values
from .coefficient import Coefficient, fraction, is_known, positive
from .stribeck_curve import STRIBECK_CURVE, AbstractStribeckCurve

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
