"""Lists of turning points."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int


def turning_points(
    ts: Float[Array, " samples"],
    x: Float[Array, " samples"],
    v: Float[Array, " samples"],
    x0: Float[Array, ""],
    capacity: int,
) -> tuple[Float[Array, " turning_points"], Int[Array, ""]]:
    """Start and reversals in order, NaN beyond them, and the number of reversals.

    A reversal lies where the velocity changes sign between two samples, and its position on the cubic through both.
    """
    if ts.shape[0] < 2:
        return jnp.full(capacity + 1, jnp.nan).at[0].set(x0), jnp.zeros((), int)
    turns = v[:-1] * v[1:] < 0
    where = jnp.nonzero(turns, size=capacity, fill_value=0)[0]
    count = jnp.minimum(jnp.sum(turns), capacity)
    h, v0, v1 = ts[where + 1] - ts[where], v[where], v[where + 1]
    u = v0 / jnp.where(v0 == v1, 1.0, v0 - v1)
    rise = x[where + 1] - x[where]
    bend, twist = 3 * rise - h * (2 * v0 + v1), h * (v0 + v1) - 2 * rise
    extremum = x[where] + u * (h * v0 + u * (bend + u * twist))
    points = jnp.where(jnp.arange(capacity) < count, extremum, jnp.nan)
    return jnp.concatenate([jnp.reshape(x0, (1,)), points]), count


def spliced(points: Float[Array, " many"], more: Float[Array, " few"], at: Int[Array, ""]) -> Float[Array, " many"]:
    """A list of turning points with others put into it from index `at` on."""
    index = jnp.arange(points.size) - at
    inside = (index >= 0) & (index < more.size)
    return jnp.where(inside, more[jnp.clip(index, 0, more.size - 1)], points)
