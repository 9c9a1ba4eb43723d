"""Steps that begin small, for contacts whose force changes within a tiny velocity.

At rest a contact of the rate-and-state kind is so stiff that a first step of ordinary size hardly moves the mass, and
no error estimate of such a step sees that a true contact gives way. Behind a reversal the steps are small anyway,
since they close in on it; a motion that begins from rest needs the same.
"""

from typing import Any

import diffrax


class FromRest(diffrax.AbstractAdaptiveStepSizeController):
    """A controller with a given first step; the following ones grow as fast as it lets them.

    Attributes:
        controller: what chooses the other steps.
        first: the first step.
    """

    controller: Any
    first: float

    def __init__(self, controller: Any, first: float = 1e-9) -> None:
        self.controller, self.first = controller, first

    @property
    def rtol(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.rtol

    @property
    def atol(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.atol

    @property
    def norm(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.norm

    def wrap(self, direction: Any) -> "FromRest":
        return FromRest(self.controller.wrap(direction), self.first)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, dt0: Any, args: Any, func: Any, error_order: Any) -> Any:
        return self.controller.init(terms, t0, t1, y0, self.first, args, func, error_order)

    def adapt_step_size(self, *step: Any) -> Any:
        return self.controller.adapt_step_size(*step)
