"""Levenberg-Marquardt as an optimistix solver that knows when a fit is finished.

Residual and Jacobian come from one pass over the model, and only ``J'J`` and ``J'r`` are kept. Damping is
Marquardt's: each parameter is scaled by the largest diagonal element of ``J'J`` met so far, so that neither the
units of the residuals nor those of the parameters matter; its strength follows the gain ratio (Nielsen,
IMM-REP-1999-05). Bounds are an active set. Coordinates in which the residual is linear are not stepped in but solved
for after every pass (variable projection).

The fit stops by statistics: when the Gauss-Newton step would move the parameters by less than a small part of their
standard errors, more steps are noise. Beside it stand the three rules of MINPACK for data without noise, put to the
Gauss-Newton step too, so that a step which damping alone made short never looks like success. A trial that is not
finite is rejected like one that makes the fit worse.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, PyTree

from .damped_step import Proposal, Setting, pressed, project, propose, units
from .loss import Squares
from .passes import AbstractPasses, DensePasses, Pass
from .status import CONVERGED, MAX_STEPS, NOT_FINITE, OUT_OF_STEPS, RUNNING, STALLED, final_status

# Of the first step, as a part of the diagonal of J'J.
_FIRST_DAMPING = 1e-4
# Part of the sum of squares below which what a Gauss-Newton step has to gain is scatter. On its scale a residual is as
# good as linear, and the step is not damped, for another pass is spent on what damping leaves of it. Where the last
# step gained less than such a part of what was foreseen, the residual is not.
_SCATTER, _FORESEEN = 0.01, 0.75
# Part of the Gauss-Newton step's gain below which a trial, after rejections, is not worth a pass.
_HOPELESS = 1e-6
# Least factors of the damping after a good step; easing fast just after a rejection runs into the same wall again.
_EASE, _EASE_AFTER_REJECTION = 0.1, 0.5
# A rejection shows that the residual is rough on this scale; then a hundred times more counts as finished.
_ROUGH = 100.0


class _State(eqx.Module):
    trial: Float[Array, " p"]
    accepted: Pass
    scale: Float[Array, " p"]
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    predicted: Float[Array, ""]
    status: Int[Array, ""]
    steps: Int[Array, ""]
    first: Bool[Array, ""]
    undamped: Bool[Array, ""]
    repeated: Bool[Array, ""]
    start_cost: Float[Array, ""]
    remaining: Float[Array, ""]


class LevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt with Marquardt scaling, Nielsen damping, bounds, projection and a statistical stopping rule.

    Pass ``options={"lower": ..., "upper": ..., "dof": ..., "floor": ...}``: bounds of shape (p,), the degrees of
    freedom, and the sum of squares that rounding alone would leave; optionally ``"linear"``: a mask of shape (p,) of
    coordinates in which the residual is linear while the other columns of the Jacobian do not depend on them. Only
    unbounded ones are projected.

    The solution's `stats` hold `status` (see `status.SENTENCES`), what the pass at the answer left behind
    (`cost`, `gradient`, `normal`, and what else is `kept`), and `remaining`, the square of the
    Gauss-Newton step left in standard errors. Auxiliary output of the function is dropped.

    Attributes:
        passes: how a pass over the model is made.
        max_steps: largest number of passes; one only evaluates where it is.
        tolerance: largest step left, in standard errors as the scatter of the residuals gives them.
        ftol: largest relative change of the sum of squares, actual and to come; also largest size of the residual
            relative to that at the start, where rounding has it.
        xtol: largest step left relative to the parameters, in the scaled norm.
        gtol: largest cosine between the residual and a column of the Jacobian.

    Raises:
        ValueError: linear coordinates under a loss other than squares.
    """

    passes: AbstractPasses = DensePasses()
    max_steps: int | Int[Array, ""] = MAX_STEPS
    tolerance: float | Float[Array, ""] = 1e-3
    ftol: float = 1e-15
    xtol: float = 1e-14
    gtol: float = 1e-15
    rtol: float = 0.0
    atol: float = 0.0
    norm: Callable = optx.max_norm

    def init(
        self, fn: Callable, y: Array, args: PyTree, options: dict, f_struct: PyTree, aux_struct: PyTree, tags: frozenset
    ) -> _State:
        if "linear" in options and not isinstance(self.passes.loss, Squares):
            raise ValueError(
                "Linear coordinates are solved for by least squares, but the loss is "
                f"{type(self.passes.loss).__name__}. Leave out the option 'linear'."
            )
        zero, none = jnp.zeros(()), jnp.asarray(0)
        nothing = self.passes.nothing(y)
        damping, status, yes = zero + _FIRST_DAMPING, jnp.asarray(RUNNING), jnp.asarray(True)
        return _State(y, nothing, jnp.zeros(y.size), damping, zero + 2, zero, status, none, yes, ~yes, ~yes, zero, zero)

    def step(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: _State, tags: frozenset
    ) -> tuple[Array, _State, None]:
        setting = Setting.of(options)
        there, move, blurred = project(self.passes(fn, state.trial, args), setting.linear)
        # What another pass has not cleared up is no model of anything.
        reached, finite = state.trial + move, there.finite & ~(blurred & state.repeated)
        reduction = state.accepted.cost - there.cost
        gain = reduction / jnp.where(state.predicted > 0, state.predicted, 1.0)
        accept = finite & (state.first | (gain > 0))
        here = jax.tree.map(lambda new, old: jnp.where(accept, new, old), there, state.accepted)
        at = jnp.where(accept, reached, y)
        least = jnp.where(state.growth > 2, _EASE_AFTER_REJECTION, _EASE)
        eased = state.damping * jnp.maximum(least, 1 - (2 * jnp.clip(gain, 0.0, 1.0) - 1) ** 3)
        # A step that was not damped says nothing of the damping.
        kept = state.first | (state.undamped & ~accept)
        damping = jnp.where(kept, state.damping, jnp.where(accept, eased, state.damping * state.growth))
        growth = jnp.where(kept, state.growth, jnp.where(accept, 2.0, state.growth * 2))
        scale = jnp.maximum(state.scale, jnp.diagonal(here.normal))
        linear = accept & (state.first | (gain > _FORESEEN))
        ahead = propose(at, here, scale, damping, setting, jnp.where(linear, 2 * _SCATTER * here.cost, 0.0))
        status, remaining = self._status(at, here, ahead, accept, reduction, state, setting)
        steps, no = state.steps + 1, jnp.asarray(False)
        begun = jnp.where(state.first, here.cost, state.start_cost)
        going = ahead.predicted, status, steps, no, ahead.undamped, no, begun, remaining
        after = _State(ahead.trial, here, scale, damping, growth, *going)
        once_more = (reached, steps, self._running(steps), ~no)
        again = eqx.tree_at(lambda s: (s.trial, s.steps, s.status, s.repeated), state, once_more)
        repeat = blurred & finite
        chosen = jax.tree.map(lambda a, b: jnp.where(repeat, a, b), again, after)
        return jnp.where(repeat, y, at), chosen, None

    def _running(self, steps: Array) -> Array:
        return jnp.where(steps < self.max_steps, RUNNING, OUT_OF_STEPS)

    def _status(
        self,
        y: Array,
        here: Pass,
        ahead: Proposal,
        accept: Array,
        reduction: Array,
        state: _State,
        setting: Setting,
    ) -> tuple[Array, Array]:
        """Status after a pass, and the square of the Gauss-Newton step in standard errors."""
        loose, unit = jnp.where(accept | state.undamped, 1.0, _ROUGH), units(here.normal)
        variance = (2 * here.cost + setting.floor) / setting.dof
        movable = ~pressed(here, setting.lower - y, setting.upper - y)
        cosine = jnp.max(jnp.where(movable, jnp.abs(here.gradient) / unit, 0.0))
        done = (
            (ahead.shortening < (loose * self.tolerance) ** 2 * variance)
            | (jnp.linalg.norm(unit * ahead.full) <= loose * self.xtol * jnp.linalg.norm(unit * y))
            | (cosine <= loose * self.gtol * jnp.sqrt(2 * here.cost))
            | (here.cost <= self.ftol**2 * state.start_cost)
            | ((jnp.abs(reduction) <= self.ftol * here.cost) & (ahead.shortening <= 2 * self.ftol * here.cost))
        )
        damped_away = ~accept & (ahead.predicted < _HOPELESS * ahead.shortening)
        stuck = damped_away | jnp.all(ahead.trial == y) | ~(ahead.predicted > 0)
        status = jnp.where(done, CONVERGED, jnp.where(stuck, STALLED, self._running(state.steps + 1)))
        status = jnp.where(state.first & ~accept, NOT_FINITE, status)
        return status, ahead.shortening / jnp.where(variance > 0, variance, 1.0)

    def terminate(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: _State, tags: frozenset
    ) -> tuple[Array, optx.RESULTS]:
        results = {
            STALLED: optx.RESULTS.nonlinear_divergence,
            NOT_FINITE: optx.RESULTS.nonfinite,
            OUT_OF_STEPS: optx.RESULTS.nonlinear_max_steps_reached,
        }
        result = optx.RESULTS.successful
        for status, outcome in results.items():
            result = optx.RESULTS.where(state.status == status, outcome, result)
        return state.status != RUNNING, result

    def postprocess(
        self,
        fn: Callable,
        y: Array,
        aux: Any,
        args: PyTree,
        options: dict,
        state: _State,
        tags: frozenset,
        result: optx.RESULTS,
    ) -> tuple[Array, None, dict[str, Any]]:
        here = state.accepted
        status = final_status(state.status, y, here.normal, Setting.of(options))
        return y, None, {"status": status, **here._asdict(), "remaining": state.remaining}
