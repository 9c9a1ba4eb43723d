"""Elementary functions whose derivatives reuse their values.

A Jacobian along several directions needs the sine, cosine and exponential of each sample once. Left to itself the
compiler computes them again for every direction, which costs more than all the rest; a barrier keeps the values.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array


@jax.custom_jvp
def rotation(angle: Array) -> tuple[Array, Array]:
    """Cosine and sine."""
    return jax.lax.optimization_barrier((jnp.cos(angle), jnp.sin(angle)))


@rotation.defjvp
def _rotation_jvp(primals: tuple, tangents: tuple) -> tuple:
    cosine, sine = rotation(*primals)
    (turn,) = tangents
    return (cosine, sine), (-sine * turn, cosine * turn)


@jax.custom_jvp
def exponential(exponent: Array) -> Array:
    """The exponential."""
    return jax.lax.optimization_barrier(jnp.exp(exponent))


@exponential.defjvp
def _exponential_jvp(primals: tuple, tangents: tuple) -> tuple:
    value = exponential(*primals)
    return value, value * tangents[0]
