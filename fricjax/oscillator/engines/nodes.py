"""Motion between nodes: quintic Hermite interpolation of position, velocity and acceleration."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .path import AbstractPath

Grid = Float[Array, "groups nodes"]


class Nodes(AbstractPath):
    """A motion known at nodes, group by group; at rest after its end where it has come to rest.

    Nodes of one group share their ends in time with the next, where the acceleration may jump; each group is
    interpolated with its own. Times before the first node continue the first step backwards.

    Attributes:
        t, x, v, a: time [s], displacement [m], velocity [m/s] and acceleration [m/s^2]; t rises within each group
            and from group to group, and stands still in groups that are not used.
        rest_position, t_stop: where the motion ends [m], [s].
        finished: whether the mass rests there.
    """

    t: Grid
    x: Grid
    v: Grid
    a: Grid
    rest_position: Float[Array, ""]
    t_stop: Float[Array, ""]
    finished: Bool[Array, ""]

    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        count = self.t.shape[1]
        index = jnp.searchsorted(jax.lax.stop_gradient(self.t).reshape(-1), ts, side="right") - 1
        index = jnp.clip(index, 0, self.t.size - 2)
        index = jnp.where(index % count == count - 1, index - 1, index)
        left = tuple(values.reshape(-1)[index] for values in (self.x, self.v, self.a))
        right = tuple(values.reshape(-1)[index + 1] for values in (self.x, self.v, self.a))
        begin, end = self.t.reshape(-1)[index], self.t.reshape(-1)[index + 1]
        running = ~(self.finished & (ts >= self.t_stop))
        h = jnp.where(running & (end > begin), end - begin, 1.0)
        value, slope = _quintic((ts - begin) / h, h, left, right)
        return jnp.where(running, value, self.rest_position), jnp.where(running, slope, 0.0)


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
