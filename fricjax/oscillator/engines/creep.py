"""Motion under a regularised law: in phase while the half-cycles last, and in time as the mass creeps home."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..motion import Start
from ..oscillator import Oscillator
from .nodes import Nodes
from .path import AbstractPath
from .smooth import Smooth

_STEPS = 1024
_ROUNDING = 1e-12


class Creeping(AbstractPath):
    """Half-cycles, and behind the last one whose phase carries it the motion that the smooth engine gives.

    Attributes:
        strokes: nodes of the half-cycles.
        oscillator: with a regularised law.
        start, time: where the half-cycles end: the state there, and the time [s].
        handed: False where there is another half-cycle, and the list of them is too short.
    """

    strokes: Nodes
    oscillator: Oscillator
    start: Start
    time: Float[Array, ""]
    handed: Bool[Array, ""]

    @property
    def turning_points(self) -> Float[Array, " turning_points"]:
        return self.strokes.turning_points

    def sample(self, ts: Float[Array, " samples"]) -> tuple[Float[Array, " samples"], Float[Array, " samples"]]:
        return self.strokes.joined(self.creep(jnp.max(ts))).sample(ts)

    def creep(self, limit: Float[Array, ""]) -> Nodes:
        """The motion behind the half-cycles until `limit` [s]; no work is done where that lies before them."""
        strokes = self.strokes

        def integrated() -> Nodes:
            # A little further, so that rounding cannot leave the last sample out.
            duration = limit * (1 + _ROUNDING) - self.time
            nodes = Smooth(max_steps=_STEPS).trail(self.oscillator, self.start, duration)
            return Nodes(nodes.t + self.time, nodes.x, nodes.v, nodes.a, strokes.rest_position, strokes.t_stop, never)

        def none() -> Nodes:
            columns = (jnp.broadcast_to(values[-1], (_STEPS + 1,)) for values in (strokes.t, strokes.x))
            zero = jnp.zeros(_STEPS + 1)
            return Nodes.of((*columns, zero, zero), strokes.rest_position, strokes.t_stop, never)

        never = jnp.asarray(False)
        return jax.lax.cond(self.handed & (limit > self.time), integrated, none)
