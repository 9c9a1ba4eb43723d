"""Quintic Hermite interpolation of a motion between nodes."""

from collections.abc import Iterable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .base import AbstractPath

Line = Float[Array, " nodes"]
Samples = Float[Array, " samples"]
_ROUNDING = 1e-14


class Nodes(AbstractPath):
    """Motion known at nodes; at rest after its end if finished.

    At a reversal, where the acceleration jumps, a node appears twice, once with the acceleration of either side. Times
    before the first node extrapolate the first step.

    Attributes:
        t, x, v, a: time [s], displacement [m], velocity [m/s] and acceleration [m/s^2]; t never decreases.
        rest_position, t_stop: position [m] and time [s] of the end.
        finished: whether the mass rests there.
        recorded: turning points, if known.
    """

    t: Line
    x: Line
    v: Line
    a: Line
    rest_position: Float[Array, ""]
    t_stop: Float[Array, ""]
    finished: Bool[Array, ""]
    recorded: Float[Array, " turning_points"] = eqx.field(default_factory=lambda: jnp.zeros(0))

    @property
    def turning_points(self) -> Float[Array, " turning_points"]:
        return self.recorded

    @classmethod
    def of(cls, columns: Iterable[Array], rest_position: Array, t_stop: Array, finished: Array) -> "Nodes":
        """Create nodes from t, x, v and a, in this order."""
        t, x, v, a = columns
        return cls(t, x, v, a, rest_position, t_stop, finished)

    def sample(self, ts: Samples) -> tuple[Samples, Samples]:
        return self._read(ts, jnp.searchsorted(jax.lax.stop_gradient(self.t), ts, side="right") - 1)

    def sample_in_order(self, ts: Samples) -> tuple[Samples, Samples]:
        """Sample as :meth:`sample`, for times in ascending order.

        The few nodes are then searched among the many times, which is faster.
        """
        first_behind = jnp.searchsorted(ts, jax.lax.stop_gradient(self.t))
        passed = jnp.zeros(ts.size, int).at[first_behind].add(1, mode="drop")
        return self._read(ts, _running_sum(passed) - 1)

    def _read(self, ts: Samples, index: Int[Array, " samples"]) -> tuple[Samples, Samples]:
        index = jnp.clip(index, 0, self.t.size - 2)
        # Twin nodes may differ by rounding.
        begin, end = (jax.lax.stop_gradient(self.t)[at] for at in (index, index + 1))
        index = jnp.where(end - begin > _ROUNDING * end, index, index - 1)
        left = tuple(values[index] for values in (self.x, self.v, self.a))
        right = tuple(values[index + 1] for values in (self.x, self.v, self.a))
        begin, end = self.t[index], self.t[index + 1]
        running = ~(self.finished & (ts >= self.t_stop))
        h = jnp.where(running & (end > begin), end - begin, 1.0)
        value, slope = quintic((ts - begin) / h, h, left, right)
        return jnp.where(running, value, self.rest_position), jnp.where(running, slope, 0.0)

    def joined(self, *others: "Nodes") -> "Nodes":
        """Append other motions; the last one defines the end."""
        parts = (self, *others)
        columns = (jnp.concatenate([getattr(part, name) for part in parts]) for name in ("t", "x", "v", "a"))
        last = parts[-1]
        return Nodes.of(columns, last.rest_position, last.t_stop, last.finished)


def _running_sum(values: Array) -> Array:
    """Compute a cumulative sum: a loop on a CPU, `cumsum` elsewhere.

    A CPU compiles the loop into a single kernel.
    """

    def loop(values: Array) -> Array:
        def add(total: Array, value: Array) -> tuple[Array, Array]:
            return total + value, total + value

        return jax.lax.scan(add, jnp.zeros_like(values[0]), values)[1]

    return jax.lax.platform_dependent(values, cpu=loop, default=jnp.cumsum)


def quintic(u: Array, h: Array, left: tuple, right: tuple) -> tuple[Array, Array]:
    """Evaluate a quintic and its derivative within a step.

    `u` is the fraction of the step `h`; value, slope and curvature are given at both ends.
    """
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


def turning_points(
    ts: Float[Array, " samples"],
    x: Float[Array, " samples"],
    v: Float[Array, " samples"],
    x0: Float[Array, ""],
    capacity: int,
) -> tuple[Float[Array, " turning_points"], Int[Array, ""]]:
    """Find the reversals in sampled motion; return start, reversals and their number.

    The velocity changes sign between two samples; the position is the extremum of the cubic through both. The list is
    padded with NaN.
    """
    if ts.shape[0] < 2:
        return jnp.full(capacity + 1, jnp.nan).at[0].set(x0), jnp.zeros((), int)
    reverses = v[:-1] * v[1:] < 0
    where = jnp.nonzero(reverses, size=capacity, fill_value=0)[0]
    count = jnp.minimum(jnp.sum(reverses), capacity)
    h, v0, v1 = ts[where + 1] - ts[where], v[where], v[where + 1]
    u = v0 / jnp.where(v0 == v1, 1.0, v0 - v1)
    rise = x[where + 1] - x[where]
    bend, twist = 3 * rise - h * (2 * v0 + v1), h * (v0 + v1) - 2 * rise
    extremum = x[where] + u * (h * v0 + u * (bend + u * twist))
    points = jnp.where(jnp.arange(capacity) < count, extremum, jnp.nan)
    return jnp.concatenate([jnp.reshape(x0, (1,)), points]), count


def spliced(points: Float[Array, " many"], more: Float[Array, " few"], at: Int[Array, ""]) -> Float[Array, " many"]:
    """Overwrite a list of turning points from index `at` on."""
    index = jnp.arange(points.size) - at
    inside = (index >= 0) & (index < more.size)
    return jnp.where(inside, more[jnp.clip(index, 0, more.size - 1)], points)
