"""Half-cycles in phase angle: any memoryless sliding law, drag and restoring force.

Amplitude and time are integrated over the phase of each half-cycle (:mod:`.frame`), on a mesh that is the same for all
of them. So there is no event to search, no jump to step over, and the derivatives are those of the discrete solution
itself. At each reversal the rest condition ``|R(y)| <= F_s`` decides whether the mass moves on.

Half-cycles of one law differ only in their amplitude. A fit, which knows the range of amplitudes from its record,
therefore integrates a dozen amplitudes side by side and reads the half-cycles off that table (:mod:`.amplitudes`).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator
from ..results import RESULTS
from .amplitudes import Span, Table, make_table, strokes_from_table
from .base import AbstractEngine
from .frame import layer_width, mesh_fractions
from .nodes import Nodes
from .strokes import Standstill, Stroke, advance, enter, stroke_from

_LAST = 2


class _Course(NamedTuple):
    """All half-cycles: their nodes, their turning points (NaN after the stop), and where they end."""

    strokes: Stroke
    turning_points: Array
    end: Standstill


class Hybrid(AbstractEngine):
    """Half-cycles in phase angle for laws without internal states.

    Attributes:
        nodes: steps per half-cycle, an even number; 32 keep the error below 0.01 nm on a 2 mm motion.
        max_half_cycles: bound on the number of half-cycles; a motion with more ends with a code of its own.
        span: range of turning points for the table of amplitudes, used where the number of half-cycles is given; None
            integrates each half-cycle for itself.
        amplitudes: number of amplitudes in the table.
    """

    nodes: int = 32
    max_half_cycles: int = 512
    span: Span | None = None
    amplitudes: int = 12

    def refusal(self, oscillator: Oscillator) -> str | None:
        if oscillator.friction.n_states:
            return (
                "The hybrid engine integrates laws without internal states, and "
                f"{type(oscillator.friction).__name__} has some. Use the smooth engine."
            )
        return None

    def finer(self) -> "Hybrid":
        return Hybrid(nodes=self.nodes * 3 // 4 * 2, max_half_cycles=self.max_half_cycles)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> Nodes:
        return _path(self._course(oscillator, start, half_cycles))

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        course = self._course(oscillator, start, half_cycles)
        end = course.end
        x, v = _path(course).sample(ts)
        at_rest = end.finished & (ts >= end.time)
        t_last = ts[-1] if ts.shape[0] else jnp.asarray(-jnp.inf)
        reached = end.forward & (end.finished | (ts <= end.time))
        short = ~end.finished & (t_last > end.time)
        done: Any = RESULTS.successful
        outcome = RESULTS.where(short, RESULTS.too_many_half_cycles, done)
        sliding = oscillator.friction_force(v, jnp.zeros(0))
        return Motion(
            t=ts,
            x=jnp.where(reached, x, jnp.nan),
            v=jnp.where(reached, v, jnp.nan),
            friction_force=jnp.where(at_rest, -oscillator.restoring_force(x), sliding),
            at_rest=at_rest,
            t_stop=jnp.where(end.finished, end.time, jnp.inf),
            turning_points=jnp.concatenate([jnp.reshape(start.x0, (1,)), course.turning_points]),
            n_half_cycles=jnp.where(end.finished, end.count, -1),
            regularisation_bias=jnp.zeros(()),
            engine="hybrid",
            result=RESULTS.where(end.forward, outcome, RESULTS.phase_reversed),
            stats={"nodes_per_half_cycle": self.nodes},
        )

    def _course(self, oscillator: Oscillator, start: Start, half_cycles: Array | None) -> _Course:
        entry = enter(oscillator, start)
        reach = jnp.abs(start.x0) + jnp.abs(start.v0) / entry.frame.angular_frequency
        fractions = mesh_fractions(self.nodes, layer_width(oscillator, entry.frame, reach))
        static = oscillator.friction.static_force(oscillator.normal_force)

        def rests(y: Array, count: Array) -> Array:
            held = jnp.abs(oscillator.restoring_force(y)) <= static
            return jnp.where(entry.moving & (count == 0), False, held) if half_cycles is None else count >= half_cycles

        def step(at: Standstill, index: Array) -> tuple[Standstill, tuple[Stroke, Array]]:
            inside = entry.moving & (index == 0)
            stroke, turned, forward = stroke_from(oscillator, start, entry, fractions, inside, at)
            after, stroke = advance(at, stroke, turned, forward, rests)
            return after, (stroke, jnp.where(at.finished, jnp.nan, after.turning_point))

        zero = jnp.zeros((), int)
        begin = Standstill(jnp.asarray(start.x0), jnp.zeros(()), zero, rests(start.x0, zero), jnp.asarray(True))
        if self.span is None or half_cycles is None:
            end, nodes = jax.lax.scan(step, begin, jnp.arange(self.max_half_cycles))
        else:
            table = make_table(oscillator, self.span, self.amplitudes, fractions)
            end, nodes = self._by_table(oscillator, table, begin, step, half_cycles)
        return _Course(*nodes, end)

    def _by_table(self, oscillator: Oscillator, table: Table, begin: Standstill, step: Any, half_cycles: Array) -> tuple:
        """The first half-cycle and the last ones each for itself, those between them from the table."""

        def leaves_the_last(y: Array, count: Array) -> Array:
            return count >= half_cycles - _LAST

        entered, first = jax.lax.scan(step, begin, jnp.arange(1))
        entered = entered._replace(finished=leaves_the_last(entered.turning_point, entered.count))
        capacity = max(self.max_half_cycles - 1 - _LAST, 1)
        reached, middle = strokes_from_table(oscillator, table, entered, leaves_the_last, capacity)
        # A record that ends in motion has no last half-cycles.
        over = (reached.count >= half_cycles) | (half_cycles > self.max_half_cycles)
        end, last = jax.lax.scan(step, reached._replace(finished=over), 1 + jnp.arange(_LAST))
        return end, jax.tree.map(lambda *parts: jnp.concatenate(parts), first, middle, last)


def _path(course: _Course) -> Nodes:
    end = course.end
    return Nodes(*course.strokes, rest_position=end.turning_point, t_stop=end.time, finished=end.finished)
