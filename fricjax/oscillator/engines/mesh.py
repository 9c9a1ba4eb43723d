"""Steps that are given beforehand, in the phase of the half-cycles and behind them in time."""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Mesh(eqx.Module):
    """Where the steps of an integration end; a list may repeat its last number, for which no work is done.

    Attributes:
        phases: phase of the motion from the start on [rad]; the mass turns at the multiples of pi.
        times: time from the end of the phases on, in radians of the natural frequency.
    """

    phases: Float[Array | np.ndarray, " phases"]
    times: Float[Array | np.ndarray, " times"]

    def begun_at(self, phase: Array) -> Array:
        """The phases of a motion that starts at `phase`: the first half-cycle is stretched, the others stay."""
        phases = jnp.asarray(self.phases)
        first = phases[0]
        turn = (jnp.floor(first / jnp.pi) + 1) * jnp.pi
        away = phase - first
        late = jnp.arctan2(jnp.sin(away), jnp.cos(away))
        return phases + late * jnp.clip((turn - phases) / (turn - first), 0.0, 1.0)


def stepped(field: Callable, solver: Any, ends: Float[Array, " ends"], y0: Any, args: Any) -> Any:
    """The states of a motion from `y0` at the ends of given steps; where the list repeats its last number, the last.

    The steps are those of a solver of diffrax, and so would be the motion by its `StepTo` and `diffeqsolve`; but what
    that provides for on the way, such as events and the end of a step that rounding has missed, is a sixth of all that
    a fit of a bristle law compiles.
    """
    terms, count = diffrax.ODETerm(field), jnp.sum(ends < ends[-1])

    def step(state: tuple) -> tuple:
        i, y, memory, saved = state
        y, _, _, memory, _ = solver.step(terms, ends[i], ends[i + 1], y, args, memory, made_jump=False)
        return i + 1, y, memory, jax.tree.map(lambda all_, one: all_.at[i + 1].set(one), saved, y)

    saved = jax.tree.map(lambda one: jnp.zeros(ends.shape).at[0].set(one), y0)
    begin = jnp.asarray(0), y0, solver.init(terms, ends[0], ends[-1], y0, args), saved
    saved = jax.lax.while_loop(lambda state: state[0] < count, step, begin)[3]
    made = jnp.minimum(jnp.arange(ends.size), count)
    return jax.tree.map(lambda values: values[made], saved)
