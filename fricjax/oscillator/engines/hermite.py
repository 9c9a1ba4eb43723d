"""Samples between the nodes of half-cycles: quintic Hermite interpolation of position, velocity and acceleration."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

Nodes = Float[Array, "half_cycles nodes"]


def _quintic(u: Array, h: Array, left: tuple, right: tuple) -> tuple[Array, Array]:
    """Value and derivative at the fraction `u` of a step `h`, from value, slope and curvature at both ends."""
    (x0, v0, a0), (x1, v1, a1) = left, right
    c1, c2 = h * v0, h**2 * a0 / 2
    rise = x1 - x0 - c1 - c2
    slope = h * (v1 - v0) - h**2 * a0
    bend = h**2 * (a1 - a0)
    c3 = 10 * rise - 4 * slope + bend / 2
    c4 = -15 * rise + 7 * slope - bend
    c5 = 6 * rise - 3 * slope + bend / 2
    value = x0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
    derivative = c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
    return value, derivative / h


def sample_nodes(
    ts: Float[Array, " samples"],
    nodes: tuple[Nodes, Nodes, Nodes, Nodes],
    rest_position: Float[Array, ""],
    t_stop: Float[Array, ""],
    finished: Bool[Array, ""],
) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
    """Displacement and velocity at `ts`, at rest after `t_stop` where the motion has finished.

    Nodes of one half-cycle share their ends in time with the next, where the acceleration jumps; each half-cycle is
    interpolated with its own. Times before the first node continue the first step backwards.
    """
    t, x, v, a = nodes
    count = t.shape[1]
    index = jnp.searchsorted(jax.lax.stop_gradient(t).reshape(-1), ts, side="right") - 1
    index = jnp.clip(index, 0, t.size - 2)
    index = jnp.where(index % count == count - 1, index - 1, index)
    left = tuple(values.reshape(-1)[index] for values in (x, v, a))
    right = tuple(values.reshape(-1)[index + 1] for values in (x, v, a))
    begin, end = t.reshape(-1)[index], t.reshape(-1)[index + 1]
    running = ~(finished & (ts >= t_stop))
    h = jnp.where(running & (end > begin), end - begin, 1.0)
    value, slope = _quintic((ts - begin) / h, h, left, right)
    return jnp.where(running, value, rest_position), jnp.where(running, slope, 0.0)
