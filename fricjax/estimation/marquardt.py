"""One step of Levenberg-Marquardt, under `numpy` and under `jax.numpy`.

The module does not import optimistix, because that takes longer than a fit. See `levenberg_marquardt` for the method.
"""

from typing import Any, NamedTuple

from jaxtyping import Array, Bool, Float, Int, PyTree

from .arrays import namespace, select
from .damped_step import Proposal, Setting, pressed, project, propose, units
from .loss import Squares
from .passes import AbstractPasses, Pass
from .status import CONVERGED, MAX_STEPS, NOT_FINITE, OUT_OF_STEPS, RUNNING, STALLED, final_status

# Initial damping relative to the diagonal of J'J.
_FIRST_DAMPING = 1e-4
# If a Gauss-Newton step can gain less than _SCATTER of the sum of squares, the gain is within the scatter. On that
# scale the residual is nearly linear, so the step is not damped; damping would cost another pass. If the previous step
# gained less than _FORESEEN of its predicted gain, the residual is not linear, and the step is damped.
_SCATTER, _FORESEEN = 0.01, 0.75
# Part of the Gauss-Newton gain below which a trial after rejections is not worth a pass.
_HOPELESS = 1e-6
# Least factors of the damping after a good step; easing quickly after a rejection leads to the next rejection.
_EASE, _EASE_AFTER_REJECTION = 0.1, 0.5
# A rejection shows that the residual is rough on this scale; the tolerances are then a hundred times larger.
_ROUGH = 100.0


class State(NamedTuple):
    """State between two steps."""

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


class Marquardt(NamedTuple):
    """Levenberg-Marquardt with the fields of `LevenbergMarquardt`."""

    passes: AbstractPasses
    max_steps: int | Int[Array, ""] = MAX_STEPS
    tolerance: float | Float[Array, ""] = 1e-3
    ftol: float = 1e-15
    xtol: float = 1e-14
    gtol: float = 1e-15

    def minimise(self, y: Any, options: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Run on NumPy arrays, without compilation.

        Returns:
            The optimum and the statistics, as `optimistix.least_squares` does.
        """
        state, count = self.init(y, options), 0
        while state.status == RUNNING:
            y, state = self.step(None, y, None, options, state)
            count += 1
        return y, {**self.statistics(y, options, state), "num_steps": count}

    def statistics(self, y: Array, options: dict[str, Any], state: State) -> dict[str, Any]:
        """Return the statistics of a finished run."""
        here = state.accepted
        status = final_status(state.status, y, here.normal, Setting.of(options))
        return {"status": status, **here._asdict(), "remaining": state.remaining}

    def init(self, y: Array, options: dict[str, Any]) -> State:
        """Return the state before the first step."""
        if "linear" in options and not isinstance(self.passes.loss, Squares):
            raise ValueError(
                "Linear coordinates are solved for by least squares, but the loss is "
                f"{type(self.passes.loss).__name__}. Leave out the option 'linear'."
            )
        xp = namespace(y)
        zero, none = xp.zeros(()), xp.asarray(0)
        nothing = self.passes.nothing(y)
        damping, status, yes = zero + _FIRST_DAMPING, xp.asarray(RUNNING), xp.asarray(True)
        return State(y, nothing, xp.zeros(y.size), damping, zero + 2, zero, status, none, yes, ~yes, ~yes, zero, zero)

    def step(self, fn: Any, y: Array, args: PyTree, options: dict[str, Any], state: State) -> tuple[Array, State]:
        """Evaluate a trial; return the accepted coordinates and the next state."""
        xp, setting = namespace(y), Setting.of(options)
        there, move, blurred = project(self.passes(fn, state.trial, args), setting.linear)
        # A pass with too much cancellation, even when repeated, is no usable model.
        reached, finite = state.trial + move, there.finite & ~(blurred & state.repeated)
        reduction = state.accepted.cost - there.cost
        gain = reduction / xp.where(state.predicted > 0, state.predicted, 1.0)
        accept = finite & (state.first | (gain > 0))
        here = select(xp, accept, there, state.accepted)
        at = xp.where(accept, reached, y)
        least = xp.where(state.growth > 2, _EASE_AFTER_REJECTION, _EASE)
        eased = state.damping * xp.maximum(least, 1 - (2 * xp.clip(gain, 0.0, 1.0) - 1) ** 3)
        # The result of an undamped step is no information about the damping.
        kept = state.first | (state.undamped & ~accept)
        damping = xp.where(kept, state.damping, xp.where(accept, eased, state.damping * state.growth))
        growth = xp.where(kept, state.growth, xp.where(accept, 2.0, state.growth * 2))
        scale = xp.maximum(state.scale, xp.diagonal(here.normal))
        linear = accept & (state.first | (gain > _FORESEEN))
        ahead = propose(at, here, scale, damping, setting, xp.where(linear, 2 * _SCATTER * here.cost, 0.0))
        status, remaining = self._status(at, here, ahead, accept, reduction, state, setting)
        steps, no = state.steps + 1, xp.asarray(False)
        begun = xp.where(state.first, here.cost, state.start_cost)
        going = ahead.predicted, status, steps, no, ahead.undamped, no, begun, remaining
        after = State(ahead.trial, here, scale, damping, growth, *going)
        again = state._replace(trial=reached, steps=steps, status=self._running(steps), repeated=~no)
        repeat = blurred & finite
        chosen = select(xp, repeat, again, after)
        return xp.where(repeat, y, at), chosen

    def _running(self, steps: Array) -> Array:
        return namespace(steps).where(steps < self.max_steps, RUNNING, OUT_OF_STEPS)

    def _status(
        self,
        y: Array,
        here: Pass,
        ahead: Proposal,
        accept: Array,
        reduction: Array,
        state: State,
        setting: Setting,
    ) -> tuple[Array, Array]:
        """Return the status and the squared Gauss-Newton step in standard errors."""
        xp = namespace(y)
        loose, unit = xp.where(accept | state.undamped, 1.0, _ROUGH), units(here.normal)
        variance = (2 * here.cost + setting.floor) / setting.dof
        movable = ~pressed(here, setting.lower - y, setting.upper - y)
        cosine = xp.max(xp.where(movable, xp.abs(here.gradient) / unit, 0.0))
        done = (
            (ahead.shortening < (loose * self.tolerance) ** 2 * variance)
            | (xp.linalg.norm(unit * ahead.full) <= loose * self.xtol * xp.linalg.norm(unit * y))
            | (cosine <= loose * self.gtol * xp.sqrt(2 * here.cost))
            | (here.cost <= self.ftol**2 * state.start_cost)
            | ((xp.abs(reduction) <= self.ftol * here.cost) & (ahead.shortening <= 2 * self.ftol * here.cost))
        )
        damped_away = ~accept & (ahead.predicted < _HOPELESS * ahead.shortening)
        stuck = damped_away | xp.all(ahead.trial == y) | ~(ahead.predicted > 0)
        status = xp.where(done, CONVERGED, xp.where(stuck, STALLED, self._running(state.steps + 1)))
        status = xp.where(state.first & ~accept, NOT_FINITE, status)
        return status, ahead.shortening / xp.where(variance > 0, variance, 1.0)
