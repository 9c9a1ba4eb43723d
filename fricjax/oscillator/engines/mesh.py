"""Steps that are given beforehand, in the phase of the half-cycles and behind them in time."""

from typing import Any

import diffrax
import equinox as eqx
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


class Given(diffrax.AbstractStepSizeController):
    """Steps that end at given instants, of which the last may stand several times."""

    ends: Any

    def __init__(self, ends: Any) -> None:
        self.ends = ends

    def wrap(self, direction: Any) -> "Given":
        return self

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: Any, args: Any, func: Any, error_order: Any) -> Any:
        return self.ends[1], jnp.asarray(2)

    def adapt_step_size(
        self, t0: Any, t1: Any, y0: Any, y1_candidate: Any, args: Any, y_error: Any, error_order: Any, state: Any
    ) -> Any:
        return True, t1, self.ends[state], False, state + 1, diffrax.RESULTS.successful
