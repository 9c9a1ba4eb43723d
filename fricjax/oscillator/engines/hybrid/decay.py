"""The half-cycles of a decay, one after the other or most of them off a table."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...motion import Start
from ...oscillator import Oscillator
from ..base import UNTABLED
from ..nodes import Nodes, spliced
from .amplitude_table import AmplitudeTable, half_cycles_from_table
from .collocation import Panels
from .grazing import MOST, grazing_half_cycles
from .half_cycles import (
    Attempt,
    HalfCycle,
    RestCondition,
    Reversal,
    advance,
    enter,
    half_cycle_by_collocation,
    half_cycle_by_steps,
)


class Decay(NamedTuple):
    """Half-cycles in phase: their nodes, their turning points (NaN behind the last), and where they end."""

    half_cycles: HalfCycle
    turning_points: Array
    end: Reversal

    @property
    def nodes(self) -> Nodes:
        """The motion so far."""
        columns = (values.reshape(-1) for values in self.half_cycles)
        return Nodes.of(columns, self.end.turning_point, self.end.time, self.end.at_rest)

    @property
    def resolved_part(self) -> Nodes:
        """The motion of a fit, which knows its number of half-cycles; NaN from where the phase does not resolve it."""
        nodes, resolved = self.nodes, self.end.resolved
        rest = jnp.where(resolved, nodes.rest_position, jnp.nan)
        points = jnp.concatenate([self.half_cycles.x[:1, 0], self.turning_points])
        # Behind the half-cycles from a table there may be room before the last ones.
        made = ~jnp.isnan(points)
        places = jnp.where(made, jnp.cumsum(made) - 1, points.size)
        points = jnp.full_like(points, jnp.nan).at[places].set(points, mode="drop")
        return Nodes(nodes.t, nodes.x, nodes.v, nodes.a, rest, nodes.t_stop, nodes.finished | ~resolved, points)


def rest_condition(oscillator: Oscillator, start: Start, half_cycles: Array | None) -> RestCondition:
    """Whether the mass stays at a turning point: by its law, or because the record says so."""
    law, load, moving = oscillator.friction, oscillator.normal_force, start.v0 != 0
    static, breakaway = law.static_force(load), law.breakaway_force(load)

    def by_law(y: Array, count: Array) -> Array:
        # A contact that has stood before the start may hold more than one that has just come to a stop.
        holds = jnp.where(count == 0, breakaway, static)
        pull = jnp.abs(oscillator.restoring_force(y)) - oscillator.hysteresis(y)
        return (pull <= holds) & ~(moving & (count == 0))

    return by_law if half_cycles is None else lambda y, count: count >= half_cycles


def one_by_one(
    oscillator: Oscillator, start: Start, fractions: Float[Array, " nodes"], rests: RestCondition, capacity: int
) -> Decay:
    """Each half-cycle integrated for itself, at most `capacity` of them."""
    entry = enter(oscillator, start)

    def attempt(at: Reversal, index: Array) -> Attempt:
        return half_cycle_by_steps(oscillator, start, entry, fractions, entry.moving & (index == 0), at)

    step = _stepper(attempt, fractions, rests)
    end, made = jax.lax.scan(step, _begin(start, rests), jnp.arange(capacity))
    return Decay(*made, end)


def by_table(
    oscillator: Oscillator,
    start: Start,
    table: AmplitudeTable,
    panels: Panels,
    half_cycles: Array,
    capacity: int,
) -> Decay:
    """The last half-cycles each for itself, those before them from the table; none from a start in motion."""
    rests = rest_condition(oscillator, start, half_cycles)
    step = _stepper(lambda at, _: half_cycle_by_collocation(oscillator, panels, at), panels.fractions, rests)

    # Near the dead band the phase leaps, which a table over the amplitude does not follow.
    def leaves_the_last(y: Array, count: Array) -> Array:
        return count >= half_cycles - UNTABLED

    begin = _begin(start, leaves_the_last)._replace(resolved=start.v0 == 0)
    reached, first = half_cycles_from_table(oscillator, table, begin, leaves_the_last, max(capacity - UNTABLED, 1))
    # A record that ends in motion has no last half-cycles.
    over = ~reached.resolved | (reached.count >= half_cycles) | (half_cycles > capacity)
    end, last = jax.lax.scan(step, reached._replace(finished=over), jnp.arange(1, UNTABLED + 1))
    nodes, points = jax.tree.map(lambda *parts: jnp.concatenate(parts), first, last)
    return Decay(nodes, points, end)


def to_rest(decay: Decay, oscillator: Oscillator, start: Start, rests: RestCondition) -> tuple[Nodes, Array, Reversal]:
    """The motion under a set-valued law, with the half-cycles that had to be integrated in time at its end.

    Returns:
        Its nodes, its turning points, NaN behind the last one, and where it ends.
    """
    before = decay.nodes

    def grazing() -> tuple[Nodes, Array, Reversal]:
        return grazing_half_cycles(oscillator, start, rests, decay.end)

    def none() -> tuple[Nodes, Array, Reversal]:
        shape = jax.eval_shape(grazing)[0].t.shape
        columns = (jnp.broadcast_to(last, shape) for last in (before.t[-1], before.x[-1], 0.0, 0.0))
        nodes = Nodes.of(columns, before.rest_position, before.t_stop, before.finished)
        return nodes, jnp.full(MOST, jnp.nan), decay.end

    nodes, points, end = jax.lax.cond(decay.end.resolved, none, grazing)
    return before.joined(nodes), spliced(decay.turning_points, points, decay.end.count), end


def _begin(start: Start, rests: RestCondition) -> Reversal:
    zero, x = jnp.zeros((), int), jnp.asarray(start.x0)
    return Reversal(x, jnp.zeros(()), zero, rests(x, zero), jnp.asarray(True))


def _stepper(
    attempt: Callable[[Reversal, Array], Attempt], fractions: Float[Array, " nodes"], rests: RestCondition
) -> Callable[[Reversal, Array], tuple[Reversal, tuple[HalfCycle, Array]]]:
    """One half-cycle after a reversal, with its next turning point; nothing where the motion is finished."""

    def step(at: Reversal, index: Array) -> tuple[Reversal, tuple[HalfCycle, Array]]:
        def none() -> tuple[Reversal, tuple[HalfCycle, Array]]:
            still = (jnp.broadcast_to(value, fractions.shape) for value in (at.time, at.turning_point, 0.0, 0.0))
            return at, (HalfCycle(*still), jnp.asarray(jnp.nan))

        return jax.lax.cond(at.finished, none, lambda: advance(at, *attempt(at, index), rests))

    return step
