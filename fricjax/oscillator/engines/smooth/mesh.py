"""Prescribed integration steps, in phase and then in time."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


class Mesh(eqx.Module):
    """Ends of integration steps, first in phase and then in time.

    Attributes:
        ends: start phase and ends of the phase steps [rad], with reversals at multiples of pi; then ends of the time
            steps relative to the last phase, in radians of the natural frequency; the remainder is padding.
        n_phase, n_time: number of phase steps and of time steps.
    """

    ends: Float[Array | np.ndarray, " ends"]
    n_phase: Int[Array | np.ndarray, ""]
    n_time: Int[Array | np.ndarray, ""]

    @classmethod
    def of(cls, phases: np.ndarray, times: np.ndarray, size: int) -> "Mesh":
        """Create a mesh padded to `size` ends.

        Each list begins with its start.
        """
        ends = np.concatenate([phases, times[1:]])
        room = np.pad(ends, (0, size - ends.size))
        return cls(room, np.asarray(phases.size - 1), np.asarray(times.size - 1))

    def begun_at(self, phase: Array) -> Array:
        """Return the ends for a motion that starts at `phase`.

        Only the first half-cycle is stretched.
        """
        ends = jnp.asarray(self.ends)
        first = ends[0]
        turn = (jnp.floor(first / jnp.pi) + 1) * jnp.pi
        away = phase - first
        late = jnp.arctan2(jnp.sin(away), jnp.cos(away))
        share = jnp.clip((turn - ends) / (turn - first), 0.0, 1.0)
        return ends + late * jnp.where(jnp.arange(ends.size) <= self.n_phase, share, 0.0)


class Steps(NamedTuple):
    """Prescribed steps: begins and ends, shape (most,), and their number."""

    begins: Array
    ends: Array
    count: Array


def stepped(field: Callable, solver: Any, steps: Steps, y0: Any, entered: Callable[[Array, Any], tuple]) -> Any:
    """Follow prescribed steps from `y0`; return the state before and after each.

    The last state fills the padding. `entered` maps the number of a step and the previous state to the state at its
    begin and the arguments of the field.

    diffrax's `StepTo` and `diffeqsolve` would give the same motion. Their support for events and for missed end points
    would add a sixth to the compilation of a bristle fit.
    """
    import diffrax

    terms = diffrax.ODETerm(field)

    def step(state: tuple) -> tuple:
        i, y, memory, saved = state
        y, args = entered(i, y)
        y, _, _, memory, _ = solver.step(terms, steps.begins[i], steps.ends[i], y, args, memory, made_jump=False)
        return i + 1, y, memory, jax.tree.map(lambda all_, one: all_.at[i + 1].set(one), saved, y)

    size, zero = steps.ends.size + 1, jnp.asarray(0)
    saved = jax.tree.map(lambda one: jnp.zeros(size).at[0].set(one), y0)
    memory = solver.init(terms, steps.begins[0], steps.ends[0], *entered(zero, y0))
    saved = jax.lax.while_loop(lambda state: state[0] < steps.count, step, (zero, y0, memory, saved))[3]
    made = jnp.minimum(jnp.arange(size), steps.count)
    return jax.tree.map(lambda values: values[made], saved)
