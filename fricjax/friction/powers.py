"""Powers of numbers that pass through zero, with finite derivatives there."""

import jax.numpy as jnp

from .base import Scalar, Values


def power(base: Values, exponent: Scalar) -> Values:
    """``|base|^exponent`` for an exponent of zero or more, with finite derivatives also where the base is zero."""
    # The stiff solver takes second derivatives, in which the inverse square of a lower floor would overflow.
    return jnp.exp(exponent * jnp.log(jnp.maximum(jnp.abs(base), 1e-150)))


def signed_power(base: Values, exponent: Scalar) -> Values:
    """``|base|^exponent sgn(base)`` for an exponent of one or more."""
    return base * power(base, exponent - 1.0)
