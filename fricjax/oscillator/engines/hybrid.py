"""Half-cycles in phase angle: any memoryless sliding law, drag and restoring force.

Amplitude and time are integrated over the phase of each half-cycle (:mod:`.frame`), on a mesh that is the same for all
of them. So there is no event to search, no jump to step over, and the derivatives are those of the discrete solution
itself. At each reversal the rest condition ``|R(y)| <= F_s`` decides whether the mass moves on.

Half-cycles of one law differ only in their amplitude. A fit, which knows the range of amplitudes from its record,
therefore integrates a dozen amplitudes side by side and reads the half-cycles off that table (:mod:`.amplitudes`).
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator
from ..results import RESULTS
from .amplitudes import Span, Table, make_table, strokes_from_table
from .base import AbstractEngine
from .creep import Creeping
from .frame import layer_width, mesh_fractions
from .grazing import STROKES, grazing_strokes
from .nodes import Nodes
from .path import AbstractPath
from .strokes import Rests, Standstill, Stroke, advance, enter, stroke_from
from .turning import spliced, turning_points

_LAST = 2
_TOO_MANY: Any = RESULTS.too_many_half_cycles


class _Course(NamedTuple):
    """Half-cycles in phase: their nodes, their turning points (NaN after the last), and where they end."""

    strokes: Stroke
    turning_points: Array
    end: Standstill

    @property
    def nodes(self) -> Nodes:
        columns = (values.reshape(-1) for values in self.strokes)
        return Nodes(*columns, self.end.turning_point, self.end.time, self.end.at_rest)


class Hybrid(AbstractEngine):
    """Half-cycles in phase angle for laws without internal states.

    Attributes:
        nodes: steps per half-cycle, an even number; 32 keep the error below 0.01 nm on a 2 mm motion.
        max_half_cycles: bound on the number of half-cycles; a motion with more ends with a code of its own.
        span: range of turning points for the table of amplitudes, used where the number of half-cycles is given; None
            integrates each half-cycle for itself.
        amplitudes: number of amplitudes in the table.
    """

    nodes: int = eqx.field(static=True, default=32)
    max_half_cycles: int = eqx.field(static=True, default=512)
    span: Span | None = None
    amplitudes: int = eqx.field(static=True, default=12)

    def refusal(self, oscillator: Oscillator) -> str | None:
        if oscillator.friction.n_states:
            return (
                "The hybrid engine integrates laws without internal states, and "
                f"{type(oscillator.friction).__name__} has some. Use the smooth engine."
            )
        return None

    def finer(self) -> "Hybrid":
        return Hybrid(self.nodes * 3 // 4 * 2, self.max_half_cycles, self.span, self.amplitudes * 3 // 2)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        course = self._course(oscillator, start, half_cycles)
        if not oscillator.friction.set_valued:
            return _creeping(course, oscillator, start)
        return self._to_rest(course, oscillator, start, half_cycles)[0]

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        course = self._course(oscillator, start, half_cycles)
        if oscillator.friction.set_valued:
            nodes, points, end = self._to_rest(course, oscillator, start, half_cycles)
            lost, stopped = RESULTS.where(end.carried, _TOO_MANY, RESULTS.phase_reversed), end.at_rest
            count = jnp.where(stopped, end.count, -1)
        else:
            creep = _creeping(course, oscillator, start).creep(ts[-1])
            nodes, stopped = course.nodes.joined(creep), jnp.asarray(False)
            points, count = _reversals(course, creep, ts[-1])
            lost = RESULTS.where(course.end.carried, _TOO_MANY, RESULTS.max_steps_reached)
        x, v = nodes.sample(ts)
        at_rest, reached = stopped & (ts >= nodes.t_stop), stopped | (ts <= nodes.t[-1])
        sliding = oscillator.friction_force(v, jnp.zeros(0))
        return Motion(
            t=ts,
            x=jnp.where(reached, x, jnp.nan),
            v=jnp.where(reached, v, jnp.nan),
            friction_force=jnp.where(at_rest, -oscillator.restoring_force(x), sliding),
            at_rest=at_rest,
            t_stop=jnp.where(stopped, nodes.t_stop, jnp.inf),
            turning_points=jnp.concatenate([jnp.reshape(start.x0, (1,)), points]),
            n_half_cycles=count,
            regularisation_bias=jnp.zeros(()),
            engine="hybrid",
            result=RESULTS.where(jnp.all(reached), RESULTS.successful, lost),
            stats={
                "nodes_per_half_cycle": self.nodes,
                "t_in_time": jnp.where(course.end.carried, jnp.inf, course.end.time),
            },
        )

    def _to_rest(
        self, course: _Course, oscillator: Oscillator, start: Start, half_cycles: Array | None
    ) -> tuple[Nodes, Array, Standstill]:
        """The motion under a set-valued law with the half-cycles that had to be integrated in time."""
        fractions, rests = self._mesh(oscillator, start), _rests(oscillator, start, half_cycles)

        def grazing() -> tuple[Nodes, Array, Standstill]:
            return grazing_strokes(oscillator, start, fractions, rests, course.end)

        def none() -> tuple[Nodes, Array, Standstill]:
            held = course.nodes
            shapes = jax.eval_shape(grazing)[0]
            columns = (jnp.broadcast_to(last, shapes.t.shape) for last in (held.t[-1], held.x[-1], 0.0, 0.0))
            nodes = Nodes(*columns, held.rest_position, held.t_stop, held.finished)
            return nodes, jnp.full(STROKES, jnp.nan), course.end

        nodes, points, end = jax.lax.cond(course.end.carried, none, grazing)
        return course.nodes.joined(nodes), spliced(course.turning_points, points, course.end.count), end

    def _mesh(self, oscillator: Oscillator, start: Start) -> Float[Array, " nodes"]:
        frame = enter(oscillator, start).frame
        reach = jnp.abs(start.x0) + jnp.abs(start.v0) / frame.angular_frequency
        return mesh_fractions(self.nodes, layer_width(oscillator, frame, reach))

    def _course(self, oscillator: Oscillator, start: Start, half_cycles: Array | None) -> _Course:
        entry, fractions = enter(oscillator, start), self._mesh(oscillator, start)
        rests = _rests(oscillator, start, half_cycles)

        def step(at: Standstill, index: Array) -> tuple[Standstill, tuple[Stroke, Array]]:
            def made() -> tuple[Standstill, tuple[Stroke, Array]]:
                inside = entry.moving & (index == 0)
                after, stroke = advance(at, *stroke_from(oscillator, start, entry, fractions, inside, at), rests)
                return after, (stroke, jnp.where(after.count == at.count, jnp.nan, after.turning_point))

            def none() -> tuple[Standstill, tuple[Stroke, Array]]:
                still = (jnp.broadcast_to(value, fractions.shape) for value in (at.time, at.turning_point, 0.0, 0.0))
                return at, (Stroke(*still), jnp.asarray(jnp.nan))

            return jax.lax.cond(at.finished, none, made)

        zero = jnp.zeros((), int)
        begin = Standstill(jnp.asarray(start.x0), jnp.zeros(()), zero, rests(start.x0, zero), jnp.asarray(True))
        if self.span is None or half_cycles is None:
            end, nodes = jax.lax.scan(step, begin, jnp.arange(self.max_half_cycles))
        else:
            table = make_table(oscillator, self.span, self.amplitudes, fractions)
            end, nodes = self._by_table(oscillator, table, begin, step, half_cycles)
        return _Course(*nodes, end)

    def _by_table(
        self, oscillator: Oscillator, table: Table, begin: Standstill, step: Any, half_cycles: Array
    ) -> tuple:
        """The first half-cycle and the last ones each for itself, those between them from the table."""

        def leaves_the_last(y: Array, count: Array) -> Array:
            return count >= half_cycles - _LAST

        entered, first = jax.lax.scan(step, begin, jnp.arange(1))
        entered = entered._replace(finished=~entered.carried | leaves_the_last(entered.turning_point, entered.count))
        capacity = max(self.max_half_cycles - 1 - _LAST, 1)
        reached, middle = strokes_from_table(oscillator, table, entered, leaves_the_last, capacity)
        # A record that ends in motion has no last half-cycles.
        over = ~reached.carried | (reached.count >= half_cycles) | (half_cycles > self.max_half_cycles)
        end, last = jax.lax.scan(step, reached._replace(finished=over), 1 + jnp.arange(_LAST))
        return end, jax.tree.map(lambda *parts: jnp.concatenate(parts), first, middle, last)


def _rests(oscillator: Oscillator, start: Start, half_cycles: Array | None) -> Rests:
    """Whether the mass stays at a turning point: by its law, or because the record says so."""
    static, moving = oscillator.friction.static_force(oscillator.normal_force), start.v0 != 0

    def by_law(y: Array, count: Array) -> Array:
        return (jnp.abs(oscillator.restoring_force(y)) <= static) & ~(moving & (count == 0))

    return by_law if half_cycles is None else lambda y, count: count >= half_cycles


def _creeping(course: _Course, oscillator: Oscillator, start: Start) -> Creeping:
    end = course.end
    v = jnp.where(end.count == 0, start.v0, 0.0)
    return Creeping(course.nodes, oscillator, Start(end.turning_point, v, jnp.zeros(0)), end.time, ~end.carried)


def _reversals(course: _Course, creep: Nodes, limit: Array) -> tuple[Array, Array]:
    """Turning points until `limit` [s], and their number."""
    points = course.turning_points
    made = course.strokes.t[:, -1] <= limit
    points = jnp.where(made, points, jnp.nan)
    later, count = turning_points(creep.t, creep.x, creep.v, creep.x[0], points.size)
    return spliced(points, later[1:], course.end.count), jnp.sum(made & ~jnp.isnan(course.turning_points)) + count
