"""Steps that are given beforehand, in the phase of the half-cycles and behind them in time."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


class Mesh(eqx.Module):
    """Where the steps of an integration end, over the phase first and then in time.

    Attributes:
        ends: the phase at which the motion starts and those at which steps end [rad], the mass turns at the multiples
            of pi; behind them the times from the last one on at which steps end, in radians of the natural frequency;
            what follows is not used.
        n_phase, n_time: number of steps over the phase, and in time.
    """

    ends: Float[Array | np.ndarray, " ends"]
    n_phase: Int[Array | np.ndarray, ""]
    n_time: Int[Array | np.ndarray, ""]

    @classmethod
    def of(cls, phases: np.ndarray, times: np.ndarray, size: int) -> "Mesh":
        """A mesh with room for `size` ends, from phases and from times, each list with where it begins."""
        ends = np.concatenate([phases, times[1:]])
        room = np.pad(ends, (0, size - ends.size))
        return cls(room, np.asarray(phases.size - 1), np.asarray(times.size - 1))

    def begun_at(self, phase: Array) -> Array:
        """The ends for a motion that starts at `phase`: the first half-cycle is stretched, the others stay."""
        ends = jnp.asarray(self.ends)
        first = ends[0]
        turn = (jnp.floor(first / jnp.pi) + 1) * jnp.pi
        away = phase - first
        late = jnp.arctan2(jnp.sin(away), jnp.cos(away))
        share = jnp.clip((turn - ends) / (turn - first), 0.0, 1.0)
        return ends + late * jnp.where(jnp.arange(ends.size) <= self.n_phase, share, 0.0)


class Steps(NamedTuple):
    """Steps that are given beforehand: where each begins and ends, shape (most,), and how many of them are made."""

    begins: Array
    ends: Array
    count: Array


def stepped(field: Callable, solver: Any, steps: Steps, y0: Any, entered: Callable[[Array, Any], tuple]) -> Any:
    """The states of a motion from `y0` on before the first of given steps and at the end of each, then the last one.

    From the number of a step and the state at the end of the one before, `entered` tells the state at its begin and the
    arguments of the field.

    The steps are those of a solver of diffrax, and so would be the motion by its `StepTo` and `diffeqsolve`; but what
    that provides for on the way, such as events and the end of a step that rounding has missed, is a sixth of all that
    a fit of a bristle law compiles.
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
