"""Step control at reversals of bristle laws and other kinks or jumps.

The rate of a bristle contains ``|v|``, which has a kink if the velocity changes sign. A step across the kink hardly
affects the motion, since its error is of second order in the step. The derivatives of the motion lose one more order,
which no error estimate of the motion detects. The error estimate is therefore raised for steps in which the velocity,
or another switching quantity of the law, changes sign. The controller then approaches the switch with a few short
steps. Elements that stick and slip change mode only between steps, so no stage within a step detects the switch; the
squared step, in scaled time, then serves as the error.

By default a controller would halve its steps towards the reversal. The velocities at both ends of a rejected step
locate it, so the next step ends there by the secant.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

# Factor on the error of a step across a switch. The controller then accepts only steps too short to affect the
# derivatives; see `step_across`.
_RAISE = 1e6


def step_across(tolerance: Array) -> Array:
    """Return an accepted step across a switch, in scaled time.

    The controller has this tolerance.
    """
    return 0.3 * jnp.sqrt(tolerance / _RAISE)


class AbstractWrapper(diffrax.AbstractAdaptiveSolver, diffrax.AbstractWrappedSolver):
    """Solver that modifies or records the steps of another solver."""

    solver: eqx.AbstractVar[Any]

    @property
    def term_structure(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.solver.interpolation_cls

    @property
    def scan_kind(self) -> Any:
        """Stage loop of a wrapped Runge-Kutta solver, which diffrax requires."""
        return self.solver.scan_kind

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return self.solver.func(terms, t0, y0, args)


class SwitchingSolver(AbstractWrapper):
    """Solver with a raised error if a switching quantity changes sign.

    Attributes:
        solver: the solver that makes the steps.
        quantities: function of time, state and arguments of the vector field; returns the switching quantities, shape
            (switches,).
        after: function of time and state at the end of a step, state at its start, and arguments; returns the state at
            the start of the next step.
    """

    solver: Any
    quantities: Callable[[Any, Any, Any], Array] = eqx.field(static=True)
    after: Callable[[Any, Any, Any, Any], Any] = eqx.field(static=True)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Any:
        return self.solver.init(terms, t0, t1, y0, args)

    def step(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any) -> Any:
        # The return map may have changed the rates since the last stage of the previous step.
        y1, error, dense, state, result = self.solver.step(terms, t0, t1, y0, args, solver_state, True)
        switched = jnp.any(self.quantities(t0, y0, args) * self.quantities(t1, y1, args) < 0)
        raised = jax.tree.map(lambda e: jnp.where(switched, _RAISE * (jnp.abs(e) + (t1 - t0) ** 2), e), error)
        # A controller compares errors with the size of the state, and inf/inf is NaN.
        finite = jnp.all(jnp.isfinite(jnp.stack(jax.tree.leaves((y1, raised)))))
        y1 = jax.tree.map(lambda end, begin: jnp.where(finite, end, begin), y1, y0)
        raised = jax.tree.map(lambda e: jnp.where(finite, e, jnp.inf), raised)
        return self.after(t1, y1, y0, args), raised, dense, state, result


# Largest part of a rejected step to try next, since the secant of a bad step may hardly shorten it.
_LONGEST = 0.95


class SecantSteps(diffrax.AbstractAdaptiveStepSizeController):
    """Controller that ends steps just before and just after a reversal.

    Attributes:
        controller: chooses all other steps; the velocity is the second component of the state.
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
