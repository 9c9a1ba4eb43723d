"""The half-cycles of a whole motion, one after the other or most of them off a table."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...motion import Start
from ...oscillator import Oscillator
from ..nodes import Nodes, spliced
from .amplitude_table import Table, strokes_from_table
from .collocation import Panels
from .grazing import STROKES, grazing_strokes
from .half_cycles import Reached, Rests, Standstill, Stroke, advance, collocated_stroke, enter, stroke_from

UNTABLED = 2
"""Half-cycles before a stop that are integrated each for itself, not read off a table."""

Step = Callable[[Standstill, Array], tuple[Standstill, tuple[Stroke, Array]]]


class Course(NamedTuple):
    """Half-cycles in phase: their nodes, their turning points (NaN behind the last), and where they end."""

    strokes: Stroke
    turning_points: Array
    end: Standstill

    @property
    def nodes(self) -> Nodes:
        """The motion so far."""
        columns = (values.reshape(-1) for values in self.strokes)
        return Nodes.of(columns, self.end.turning_point, self.end.time, self.end.at_rest)

    @property
    def only_carried(self) -> Nodes:
        """The motion of a fit, which knows its number of half-cycles; NaN from where the phase does not carry it."""
        nodes, carried = self.nodes, self.end.carried
        rest = jnp.where(carried, nodes.rest_position, jnp.nan)
        points = jnp.concatenate([self.strokes.x[:1, 0], self.turning_points])
        return Nodes(nodes.t, nodes.x, nodes.v, nodes.a, rest, nodes.t_stop, nodes.finished | ~carried, points)


def rest_condition(oscillator: Oscillator, start: Start, half_cycles: Array | None) -> Rests:
    """Whether the mass stays at a turning point: by its law, or because the record says so."""
    law, load, moving = oscillator.friction, oscillator.normal_force, start.v0 != 0
    static, breakaway = law.static_force(load), law.breakaway_force(load)

    def by_law(y: Array, count: Array) -> Array:
        holds = jnp.where(count == 0, breakaway, static)
        pull = jnp.abs(oscillator.restoring_force(y)) - oscillator.hysteresis(y)
        return (pull <= holds) & ~(moving & (count == 0))

    return by_law if half_cycles is None else lambda y, count: count >= half_cycles


def one_by_one(
    oscillator: Oscillator, start: Start, fractions: Float[Array, " nodes"], rests: Rests, capacity: int
) -> Course:
    """Each half-cycle integrated for itself, at most `capacity` of them."""
    entry = enter(oscillator, start)

    def make(at: Standstill, index: Array) -> Reached:
        return stroke_from(oscillator, start, entry, fractions, entry.moving & (index == 0), at)

    step = _stepper(make, fractions, rests)
    end, made = jax.lax.scan(step, _begin(start, rests), jnp.arange(capacity))
    return Course(*made, end)


def by_table(
    oscillator: Oscillator,
    start: Start,
    table: Table,
    panels: Panels,
    half_cycles: Array,
    capacity: int,
) -> Course:
    """The last half-cycles each for itself, those before them from the table; not carried from a start in motion."""
    rests = rest_condition(oscillator, start, half_cycles)
    step = _stepper(lambda at, _: collocated_stroke(oscillator, panels, at), panels.fractions, rests)

    def leaves_the_last(y: Array, count: Array) -> Array:
        return count >= half_cycles - UNTABLED

    begin = _begin(start, leaves_the_last)._replace(carried=start.v0 == 0)
    reached, first = strokes_from_table(oscillator, table, begin, leaves_the_last, max(capacity - UNTABLED, 1))
    # A record that ends in motion has no last half-cycles.
    over = ~reached.carried | (reached.count >= half_cycles) | (half_cycles > capacity)
    end, last = jax.lax.scan(step, reached._replace(finished=over), jnp.arange(1, UNTABLED + 1))
    strokes, points = jax.tree.map(lambda *parts: jnp.concatenate(parts), first, last)
    return Course(strokes, points, end)


def to_rest(course: Course, oscillator: Oscillator, start: Start, rests: Rests) -> tuple[Nodes, Array, Standstill]:
    """The motion under a set-valued law, with the half-cycles that had to be integrated in time at its end.

    Returns:
        Its nodes, its turning points, NaN behind the last one, and where it ends.
    """
    held = course.nodes

    def grazing() -> tuple[Nodes, Array, Standstill]:
        return grazing_strokes(oscillator, start, rests, course.end)

    def none() -> tuple[Nodes, Array, Standstill]:
        shape = jax.eval_shape(grazing)[0].t.shape
        columns = (jnp.broadcast_to(last, shape) for last in (held.t[-1], held.x[-1], 0.0, 0.0))
        nodes = Nodes.of(columns, held.rest_position, held.t_stop, held.finished)
        return nodes, jnp.full(STROKES, jnp.nan), course.end

    nodes, points, end = jax.lax.cond(course.end.carried, none, grazing)
    return held.joined(nodes), spliced(course.turning_points, points, course.end.count), end


def _begin(start: Start, rests: Rests) -> Standstill:
    zero, x = jnp.zeros((), int), jnp.asarray(start.x0)
    return Standstill(x, jnp.zeros(()), zero, rests(x, zero), jnp.asarray(True))


def _stepper(make: Callable[[Standstill, Array], Reached], fractions: Float[Array, " nodes"], rests: Rests) -> Step:
    """One half-cycle after a standstill, with its next turning point; nothing where the motion is finished."""

    def step(at: Standstill, index: Array) -> tuple[Standstill, tuple[Stroke, Array]]:
        def made() -> tuple[Standstill, tuple[Stroke, Array]]:
            after, stroke = advance(at, *make(at, index), rests)
            return after, (stroke, jnp.where(after.count == at.count, jnp.nan, after.turning_point))

        def none() -> tuple[Standstill, tuple[Stroke, Array]]:
            still = (jnp.broadcast_to(value, fractions.shape) for value in (at.time, at.turning_point, 0.0, 0.0))
            return at, (Stroke(*still), jnp.asarray(jnp.nan))

        return jax.lax.cond(at.finished, none, made)

    return step
