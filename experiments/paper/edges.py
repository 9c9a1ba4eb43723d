"""Edges of the map from initial to final displacement, by bisection.

The bisection uses fricjax's map. From one segment to the next the mass makes one more half-cycle, and the slope of the
map changes its sign.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import fricjax as fj

BISECTIONS = 60


class Edges(NamedTuple):
    """All edges in a range, in order.

    Attributes:
        x0: initial displacements of the edges [m].
        below, above: final displacement just before and just after each edge [m].
        slope: slope of the segment that begins at each edge [1].
    """

    x0: np.ndarray
    below: np.ndarray
    above: np.ndarray
    slope: np.ndarray


def find(machine: fj.Oscillator, x0: np.ndarray) -> Edges:
    """Find edges between the displacements of a grid.

    The grid must be finer than the segments.
    """
    low, high = _bisect(machine, x0[:-1], x0[1:])
    below, falling = displacement_and_slope(machine, low)
    above, rising = displacement_and_slope(machine, high)
    found = np.asarray(jnp.sign(falling) != jnp.sign(rising))
    return Edges(*(np.asarray(values)[found] for values in (low, below, above, rising)))


@jax.jit
def displacement_and_slope(machine: fj.Oscillator, x0: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the map and its exact derivative."""

    def one(x: jax.Array) -> tuple[jax.Array, jax.Array]:
        return jax.jvp(lambda s: fj.final_displacement(machine, s, engine="exact"), (x,), (jnp.ones(()),))

    return jax.vmap(one)(jnp.asarray(x0))


@jax.jit
def _bisect(machine: fj.Oscillator, low: jax.Array, high: jax.Array) -> tuple[jax.Array, jax.Array]:
    side = jnp.sign(displacement_and_slope(machine, low)[1])

    def halve(_: int, ends: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        middle = (ends[0] + ends[1]) / 2
        before = jnp.sign(displacement_and_slope(machine, middle)[1]) == side
        return jnp.where(before, middle, ends[0]), jnp.where(before, ends[1], middle)

    return jax.lax.fori_loop(0, BISECTIONS, halve, (jnp.asarray(low), jnp.asarray(high)))
