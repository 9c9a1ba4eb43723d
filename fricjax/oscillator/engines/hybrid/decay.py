"""Sequence of the half-cycles of a decay, integrated individually or interpolated."""

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
from .grazing import MOST, NODES, grazing_half_cycles
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
    """Half-cycles integrated in phase.

    Attributes:
        half_cycles: their nodes.
        turning_points: turning point after each half-cycle [m]; NaN after the last one.
        end: reversal at the end.
    """

    half_cycles: HalfCycle
    turning_points: Array
    end: Reversal

    @property
    def nodes(self) -> Nodes:
        """Motion of the half-cycles so far."""
        columns = (values.reshape(-1) for values in self.half_cycles)
        return Nodes.of(columns, self.end.turning_point, self.end.time, self.end.at_rest)

    @property
    def resolved_part(self) -> Nodes:
        """Motion for a fit with a known number of half-cycles.

        NaN from the point at which the phase does not resolve it.
        """
        nodes, resolved = self.nodes, self.end.resolved
        rest = jnp.where(resolved, nodes.rest_position, jnp.nan)
        points = jnp.concatenate([self.half_cycles.x[:1, 0], self.turning_points])
        # There may be a gap between the half-cycles from a table and the last ones.
        made = ~jnp.isnan(points)
        places = jnp.where(made, jnp.cumsum(made) - 1, points.size)
        points = jnp.full_like(points, jnp.nan).at[places].set(points, mode="drop")
        return Nodes(nodes.t, nodes.x, nodes.v, nodes.a, rest, nodes.t_stop, nodes.finished | ~resolved, points)


def rest_condition(oscillator: Oscillator, start: Start, half_cycles: Array | None) -> RestCondition:
    """Return the condition for resting at a turning point.

    It is the law's condition, or a given number of half-cycles.
    """
    law, load, moving = oscillator.friction, oscillator.normal_force, start.v0 != 0
    static, breakaway = law.static_force(load), law.breakaway_force(load)

    def by_law(y: Array, count: Array) -> Array:
        # A contact that has aged before the start may hold more than one that has just stopped.
        holds = jnp.where(count == 0, breakaway, static)
        pull = jnp.abs(oscillator.restoring_force(y)) - oscillator.hysteresis(y)
        return (pull <= holds) & ~(moving & (count == 0))

    return by_law if half_cycles is None else lambda y, count: count >= half_cycles


def one_by_one(
    oscillator: Oscillator, start: Start, fractions: Float[Array, " nodes"], rests: RestCondition, capacity: int
) -> Decay:
    """Integrate each half-cycle individually, at most `capacity` of them."""
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
    """Interpolate half-cycles in a table, and integrate the last ones individually.

    Requires a start from rest; otherwise it makes no half-cycles.
    """
    rests = rest_condition(oscillator, start, half_cycles)
    step = _stepper(lambda at, _: half_cycle_by_collocation(oscillator, panels, at), panels.fractions, rests)

    # Near the dead band the phase leaps, which a table over the amplitude cannot represent.
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
    """Complete the motion under a set-valued law up to rest.

    The last half-cycles may have to be integrated in time.

    Returns:
        The nodes, the turning points, padded with NaN, and the final reversal.
    """
    before = decay.nodes

    def grazing() -> tuple[Nodes, Array, Reversal]:
        return grazing_half_cycles(oscillator, start, rests, decay.end)

    def none() -> tuple[Nodes, Array, Reversal]:
        columns = (jnp.full(NODES, last) for last in (before.t[-1], before.x[-1], 0.0, 0.0))
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
    """Return a scan step for one half-cycle; it does nothing once finished."""

    def step(at: Reversal, index: Array) -> tuple[Reversal, tuple[HalfCycle, Array]]:
        def none() -> tuple[Reversal, tuple[HalfCycle, Array]]:
            still = (jnp.broadcast_to(value, fractions.shape) for value in (at.time, at.turning_point, 0.0, 0.0))
            return at, (HalfCycle(*still), jnp.asarray(jnp.nan))

        return jax.lax.cond(at.finished, none, lambda: advance(at, *attempt(at, index), rests))

    return step
