"""Half-cycles in phase angle, for laws without internal states.

Amplitude and time are integrated over the phase of each half-cycle (:mod:`.frame`), on the same mesh for all of them.
No event search is needed, no step crosses a jump, and the derivatives are those of the discrete solution. At each
reversal the rest condition ``|R(y)| <= F_s`` decides whether the mass moves on.

A half-cycle with a phase that does not advance steadily is integrated in time. Under a set-valued law this is a
half-cycle that barely starts (:mod:`.grazing`); under a regularised law it is the final creep (:class:`Creeping`).

Half-cycles of one law differ only in their amplitude. A fit knows the range of amplitudes from its record. It therefore
solves a dozen amplitudes in parallel (:mod:`.collocation`) and interpolates the half-cycles (:mod:`.amplitude_table`).
"""

import math
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...motion import Motion, Start
from ...oscillator import Oscillator
from ..base import AbstractEngine, AbstractPath, Demands
from ..nodes import Nodes, spliced, turning_points
from .amplitude_table import Span, make_table, table_for
from .collocation import make_panels
from .decay import Decay, by_table, one_by_one, rest_condition, to_rest
from .half_cycles import RestCondition, enter
from .phase_steps import layer_width, separatrix_width

# Steps per half-cycle that keep the error [m] of a motion of a few millimetres, and the order of the method.
_NODES, _ERROR, _ORDER = 28, 1e-10, 6

# Skew of the mesh and margin of the table in the engine for error estimates.
_SKEW, _MARGIN = 0.2, 0.05

# Steps of the smooth engine for the creep after the half-cycles of a regularised law.
_CREEP_STEPS = 1024
# Relative extension of the creep beyond the last sample, so that rounding cannot exclude it.
_BEYOND = 1e-12


def nodes_for(accuracy: float) -> int:
    """Return the even number of steps per half-cycle for an accuracy [m]."""
    return 2 * max(8, math.ceil(_NODES / 2 * (_ERROR / accuracy) ** (1 / _ORDER)))


def _accuracy_of(nodes: int) -> float:
    """Return the accuracy [m] of a number of steps per half-cycle."""
    return _ERROR * (_NODES / nodes) ** _ORDER


class Creeping(AbstractPath):
    """Half-cycles in phase, followed by creep from the smooth engine.

    Attributes:
        half_cycles: nodes of the half-cycles.
        oscillator: with a regularised law.
        start, time: state and time [s] at the end of the half-cycles.
        creeps: False if another half-cycle follows but the capacity is exhausted.
        accuracy: target for the error of the creep [m].
    """

    half_cycles: Nodes
    oscillator: Oscillator
    start: Start
    time: Float[Array, ""]
    creeps: Bool[Array, ""]
    accuracy: float = eqx.field(static=True)

    @classmethod
    def behind(cls, decay: Decay, oscillator: Oscillator, start: Start, nodes: int) -> "Creeping":
        """Continue half-cycles of `nodes` steps that begin at `start`."""
        end = decay.end
        v = jnp.where(end.count == 0, start.v0, 0.0)
        left = Start(end.turning_point, v, jnp.zeros(0))
        return cls(decay.nodes, oscillator, left, end.time, ~end.resolved, _accuracy_of(nodes))

    @property
    def turning_points(self) -> Float[Array, " turning_points"]:
        return self.half_cycles.turning_points

    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        return self.half_cycles.joined(self.creep(jnp.max(ts))).sample(ts)

    def creep(self, limit: Float[Array, ""]) -> Nodes:
        """Return the motion after the half-cycles up to `limit` [s].

        No work is done if `limit` lies before their end.
        """
        before, never = self.half_cycles, jnp.asarray(False)

        def integrated() -> Nodes:
            from ..smooth import Smooth

            duration = limit * (1 + _BEYOND) - self.time
            nodes = Smooth(self.accuracy, max_steps=_CREEP_STEPS).trail(self.oscillator, self.start, duration)
            return Nodes(nodes.t + self.time, nodes.x, nodes.v, nodes.a, before.rest_position, before.t_stop, never)

        def none() -> Nodes:
            columns = (jnp.broadcast_to(values[-1], (_CREEP_STEPS + 1,)) for values in (before.t, before.x))
            zero = jnp.zeros(_CREEP_STEPS + 1)
            return Nodes.of((*columns, zero, zero), before.rest_position, before.t_stop, never)

        return jax.lax.cond(self.creeps & (limit > self.time), integrated, none)


class Hybrid(AbstractEngine):
    """Half-cycles in phase angle for laws without internal states.

    Attributes:
        nodes: steps per half-cycle, an even number; 28 keep the error below 0.1 nm on a motion of 2 mm.
        max_half_cycles: maximum number of half-cycles; a longer motion ends with the result `too_many_half_cycles`.
        span: range of turning points for the table of amplitudes. The table is used if the number of half-cycles is
            given and the motion starts from rest; None integrates each half-cycle individually.
        amplitudes: number of amplitudes in the table.
        skew: relative shift of mesh density towards the reversals, away from the optimum.

    Examples:
        A finer engine has half as many steps again:

        >>> Hybrid(nodes=28).finer().nodes
        42
    """

    name: ClassVar[str] = "hybrid"
    counted: ClassVar[tuple[str, ...]] = ("nodes_per_half_cycle", "t_handover")
    needs_mesh: ClassVar[bool] = False
    nodes: int = eqx.field(static=True, default=32)
    max_half_cycles: int = eqx.field(static=True, default=512)
    span: Span | None = None
    amplitudes: int = eqx.field(static=True, default=12)
    skew: float | Array | np.ndarray = 0.0

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        if oscillator.friction.n_states:
            return (
                "The hybrid engine integrates laws without internal states, and "
                f"{type(oscillator.friction).__name__} has some. Use the smooth engine."
            )
        return None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Hybrid":
        skew, table = np.asarray(self.skew), table_for(oscillator, demands)
        if table is None:
            return Hybrid(self.nodes, self.max_half_cycles, None, skew=skew)
        return Hybrid(self.nodes, self.max_half_cycles, *table, skew)

    def checking(self) -> "Hybrid":
        # Shifting the nodes changes the interpolation error, of sixth order in the step, by a factor of three or a
        # third nearly everywhere; a wider table has a larger error.
        span = None if self.span is None else self.span._replace(margin=np.asarray(_MARGIN))
        return Hybrid(self.nodes, self.max_half_cycles, span, self.amplitudes, np.asarray(_SKEW))

    def finer(self) -> "Hybrid":
        return Hybrid(self.nodes * 3 // 4 * 2, self.max_half_cycles, self.span, self.amplitudes * 3 // 2, self.skew)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        decay, rests = self._decay(oscillator, start, half_cycles)
        if half_cycles is not None:
            return decay.resolved_part
        if oscillator.friction.set_valued:
            return to_rest(decay, oscillator, start, rests)[0]
        return Creeping.behind(decay, oscillator, start, self.nodes)

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        from ...outcome import RESULTS

        codes: Any = RESULTS  # pyright does not know the members of an equinox enumeration
        decay, rests = self._decay(oscillator, start, half_cycles)
        if oscillator.friction.set_valued:
            nodes, points, end = to_rest(decay, oscillator, start, rests)
            lost, stopped = codes.where(end.resolved, codes.too_many_half_cycles, codes.phase_reversed), end.at_rest
            count = jnp.where(stopped, end.count, -1)
        else:
            creep = Creeping.behind(decay, oscillator, start, self.nodes).creep(ts[-1])
            nodes, stopped = decay.nodes.joined(creep), jnp.asarray(False)
            made = decay.half_cycles.t[:, -1] <= ts[-1]
            points = jnp.where(made, decay.turning_points, jnp.nan)
            later, more = turning_points(creep.t, creep.x, creep.v, creep.x[0], points.size)
            points = spliced(points, later[1:], decay.end.count)
            count = jnp.sum(made & ~jnp.isnan(decay.turning_points)) + more
            lost = codes.where(decay.end.resolved, codes.too_many_half_cycles, codes.max_steps_reached)
        x, v = nodes.sample_in_order(ts)
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
            engine=self.name,
            result=codes.where(jnp.all(reached), codes.successful, lost),
            stats={
                "nodes_per_half_cycle": self.nodes,
                "t_handover": jnp.where(decay.end.resolved, jnp.inf, decay.end.time),
            },
        )

    def _decay(self, oscillator: Oscillator, start: Start, half_cycles: Array | None) -> tuple[Decay, RestCondition]:
        """Return the half-cycles in phase and their rest condition."""
        frame = enter(oscillator, start).frame
        reach = jnp.abs(start.x0) + jnp.abs(start.v0) / frame.angular_frequency
        swing = jnp.hypot(oscillator.restoring.stretched(start.x0), start.v0 / frame.angular_frequency)
        layer = jnp.minimum(layer_width(oscillator, frame, reach), separatrix_width(oscillator, swing))
        panels = make_panels(self.nodes, layer, self.skew)
        rests, capacity = rest_condition(oscillator, start, half_cycles), self.max_half_cycles
        if self.span is None or half_cycles is None:
            return one_by_one(oscillator, start, panels.fractions, rests, capacity), rests
        table = make_table(oscillator, self.span, self.amplitudes, panels)
        return by_table(oscillator, start, table, panels, half_cycles, capacity), rests
