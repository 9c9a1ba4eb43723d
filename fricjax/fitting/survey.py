"""One pass over all samples at the optimum: residual, gradient and normal matrix, in bounded memory.

The motion and its derivatives along all coordinates are computed once, as a path with tangents; the samples are then
read off it in chunks, each of which adds its share to ``J'J`` and ``J'r``. So ten million samples need no more memory
for derivatives than ten thousand.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .loss import AbstractLoss
from .passes import gather, residual_and_jacobian
from .residual import Course, Residual, Run

CHUNK = 2048


class Survey(NamedTuple):
    """What a pass over all samples leaves behind.

    Attributes:
        residual: weighted residual of all samples and priors, shape (residuals,).
        chi2: its sum of squares.
        gradient: J'r, shape (coordinates,), each sample weighted as its loss says.
        normal: J'J, shape (coordinates, coordinates), likewise.
    """

    residual: Any
    chi2: Any
    gradient: Any
    normal: Any


@eqx.filter_jit
def survey(residual: Residual, y: Float[Array, " coordinates"], loss: AbstractLoss) -> Survey:
    """Residual, gradient and normal matrix at coordinates `y`, from every sample."""
    parts = residual.each(lambda number, run: _run(residual, y, number, run, loss), residual.runs)
    priors, slopes = residual_and_jacobian(residual.priors, y)
    parts.append(Survey(priors, priors @ priors, slopes.T @ priors, slopes.T @ slopes))
    joined = jnp.concatenate([part.residual for part in parts])
    sums = (sum(values) for values in zip(*(part[1:] for part in parts), strict=True))
    return Survey(joined, *sums)


def _run(residual: Residual, y: Array, number: Any, data: Run, loss: AbstractLoss) -> Survey:
    n = data.t.shape[0]
    pieces = -(-n // CHUNK)
    t, x = (jnp.pad(values, (0, pieces * CHUNK - n), mode="edge") for values in (data.t, data.x))
    weight = jnp.pad(data.weight, (0, pieces * CHUNK - n))

    def course(at: Array) -> tuple[Course, tuple[Course, Course]]:
        moving, fixed = eqx.partition(residual.course(at, number, data), eqx.is_inexact_array)
        return moving, (moving, fixed)

    tangents, (moving, fixed) = jax.jacfwd(course, has_aux=True)(y)

    def chunk(number: Array, so_far: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        gradient, normal, whole = so_far
        times, seen, used = (jax.lax.dynamic_slice(values, (number * CHUNK,), (CHUNK,)) for values in (t, x, weight))

        def read(at: Course) -> Array:
            return used * (eqx.combine(at, fixed).read(times) - seen)

        r, along = jax.linearize(read, moving)
        columns = jax.vmap(along, in_axes=-1, out_axes=-1)(tangents)
        found = gather(r, columns, loss)
        whole = jax.lax.dynamic_update_slice(whole, r, (number * CHUNK,))
        return gradient + found.gradient, normal + found.normal, whole

    zero = jnp.zeros(y.shape)
    # Behind the last sample of any weight there is only filling.
    last = jnp.max(jnp.where(weight > 0, jnp.arange(weight.size), -1))
    begin = zero, zero[:, None] * zero, jnp.zeros(weight.shape)
    gradient, normal, r = jax.lax.fori_loop(0, last // CHUNK + 1, chunk, begin)
    return Survey(r[:n], jnp.sum(r**2), gradient, normal)
