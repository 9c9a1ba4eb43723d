"""Steps that land on the reversals of a bristle law, and wherever else its rates have a kink or a jump.

The rate of a bristle contains ``|v|``, which has a kink where the velocity changes sign. A step across the kink costs
the motion little, for its error is of second order in the step; but the derivatives of the motion lose one order
more, and no error estimate of the motion sees that. So the estimate is raised for steps in which the velocity, or
another quantity that a law switches by, changes sign: the controller then closes in on the switch, at the price of a
few short steps. Elements that stick and slip change their mode only between two steps, so that within a step no stage
shows the switch; the square of the step, in scaled time, stands for its error then.

Left alone a controller would halve its way towards the reversal. The velocities at both ends of a refused step tell
where it is, so the next step ends there, by the secant.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

# Factor on the error of a step across a switch: with it a controller accepts only steps that are too short for what
# they miss to be felt in the derivatives; see `step_across`.
_RAISE = 1e6


def step_across(tolerance: Array) -> Array:
    """A step across a switch that a controller with this tolerance accepts, in scaled time."""
    return 0.3 * jnp.sqrt(tolerance / _RAISE)


class AbstractWrapper(diffrax.AbstractAdaptiveSolver, diffrax.AbstractWrappedSolver):
    """A solver whose steps are made by another one, and changed or looked at before they are handed on."""

    solver: eqx.AbstractVar[Any]

    @property
    def term_structure(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.interpolation_cls

    @property
    def scan_kind(self) -> Any:
        """How a wrapped Runge-Kutta solver loops over its stages: diffrax asks for it."""
        return self.solver.scan_kind

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return self.solver.func(terms, t0, y0, args)


class SwitchingSolver(AbstractWrapper):
    """A solver with its error raised where a watched quantity changes sign.

    Attributes:
        solver: the solver that makes the steps.
        quantities: from time, state and the arguments of the vector field to the quantities, shape (switches,).
        after: from time and state at the end of a step, the state at its begin and the arguments to the state from
            which the next step begins.
    """

    solver: Any
    quantities: Callable[[Any, Any, Any], Array] = eqx.field(static=True)
    after: Callable[[Any, Any, Any, Any], Any] = eqx.field(static=True)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Any:
        return self.solver.init(terms, t0, t1, y0, args)

    def step(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any) -> Any:
        # The return map may have changed the rates since the last stage of the step before.
        y1, error, dense, state, result = self.solver.step(terms, t0, t1, y0, args, solver_state, True)
        switched = jnp.any(self.quantities(t0, y0, args) * self.quantities(t1, y1, args) < 0)
        raised = jax.tree.map(lambda e: jnp.where(switched, _RAISE * (jnp.abs(e) + (t1 - t0) ** 2), e), error)
        # A controller compares errors with the size of the state, and infinity with infinity is no number.
        finite = jnp.all(jnp.isfinite(jnp.stack(jax.tree.leaves((y1, raised)))))
        y1 = jax.tree.map(lambda end, begin: jnp.where(finite, end, begin), y1, y0)
        raised = jax.tree.map(lambda e: jnp.where(finite, e, jnp.inf), raised)
        return self.after(t1, y1, y0, args), raised, dense, state, result


# Of a refused step at most this part is tried next, for a secant of a bad step may hardly shorten it.
_LONGEST = 0.95


class SecantSteps(diffrax.AbstractAdaptiveStepSizeController):
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

    def wrap(self, direction: Any) -> "SecantSteps":
        return SecantSteps(self.controller.wrap(direction), self.last)

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
