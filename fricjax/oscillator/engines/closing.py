"""Steps that close in on a reversal by the secant, for contacts whose rates have a kink there.

A step across the kink is refused (:mod:`.landing`), and the controller alone would halve its way towards the reversal.
The velocities at both ends of the refused step tell where it is.
"""

from typing import Any

import diffrax
import jax.numpy as jnp

# Of a refused step at most this part is tried next, for a secant of a bad step may hardly shorten it.
_LONGEST = 0.95


class Closing(diffrax.AbstractAdaptiveStepSizeController):
    """A controller that ends a step just before the reversal, and the next one just behind it.

    Attributes:
        controller: what chooses the steps elsewhere; the velocity is the second component of the state.
        last: step that is certainly accepted across a reversal, in scaled time.
    """

    controller: diffrax.PIDController
    last: Any

    def __init__(self, controller: diffrax.PIDController, last: Any) -> None:
        self.controller, self.last = controller, last

    @property
    def rtol(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.rtol

    @property
    def atol(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.atol

    @property
    def norm(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.norm

    def wrap(self, direction: Any) -> "Closing":
        return Closing(self.controller.wrap(direction), self.last)

    def init(self, *start: Any) -> Any:
        return self.controller.init(*start)

    def adapt_step_size(
        self, t0: Any, t1: Any, y0: Any, y1_candidate: Any, args: Any, y_error: Any, error_order: Any, state: Any
    ) -> Any:
        kept, next_t0, next_t1, jump, state, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, state
        )
        before, behind = y0[1], y1_candidate[1]
        crossed = ~kept & (before * behind < 0)
        share = before / jnp.where(crossed, before - behind, 1.0)
        reach = jnp.minimum(share, _LONGEST) * (t1 - t0)
        across = jnp.minimum(self.last, next_t1 - next_t0)
        short = jnp.where(reach > self.last / 2, reach - self.last / 4, across)
        return kept, next_t0, jnp.where(crossed, next_t0 + short, next_t1), jump, state, result
