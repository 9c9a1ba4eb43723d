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

CHUNK = 16384


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
    size = -(-n // pieces)
    chunks = (
        _split(data.t, pieces, size, "edge"),
        _split(data.x, pieces, size, "edge"),
        _split(data.weight, pieces, size, "constant"),
    )

    def course(at: Array) -> tuple[Course, tuple[Course, Course]]:
        moving, fixed = eqx.partition(residual.course(at, number, data), eqx.is_inexact_array)
        return moving, (moving, fixed)

    tangents, (moving, fixed) = jax.jacfwd(course, has_aux=True)(y)

    def chunk(total: tuple[Array, Array], part: tuple) -> tuple[tuple[Array, Array], Array]:
        t, x, weight = part

        def read(at: Course) -> Array:
            return weight * (eqx.combine(at, fixed).read(t) - x)

        r, along = jax.linearize(read, moving)
        columns = jax.vmap(along, in_axes=-1, out_axes=-1)(tangents)
        found = gather(r, columns, loss)
        return (total[0] + found.gradient, total[1] + found.normal), r

    zero = jnp.zeros(y.shape)
    (gradient, normal), r = jax.lax.scan(chunk, (zero, zero[:, None] * zero), chunks)
    return Survey(r.reshape(-1)[:n], jnp.sum(r**2), gradient, normal)


def _split(values: Array, pieces: int, size: int, mode: str) -> Array:
    """Samples in chunks of equal size; the last one is filled up with samples of no weight."""
    return jnp.pad(values, (0, pieces * size - values.shape[0]), mode=mode).reshape(pieces, size)
