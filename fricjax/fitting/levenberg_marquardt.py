"""Levenberg-Marquardt as an optimistix solver that knows when a fit is finished.

Residual and Jacobian come from one pass over the model, and only ``J'J`` and ``J'r`` are kept. Damping is
Marquardt's: each parameter is scaled by the largest diagonal element of ``J'J`` met so far, so that neither the
units of the residuals nor those of the parameters matter; its strength follows the gain ratio (Nielsen,
IMM-REP-1999-05). Bounds are an active set: a parameter at its bound that the gradient presses outward is held for
the step, and steps are cut off at the box.

The fit stops by statistics: when the Gauss-Newton step would move the parameters by less than a small part of their
standard errors, more steps are noise. A trial that is not finite is rejected like one that makes the fit worse.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, PyTree

RUNNING, CONVERGED, STALLED, NOT_FINITE = range(4)

_FIRST_DAMPING = 1e-4
_LARGEST_DAMPING = 1e12
_NEAR = 1e-2


class Pass(NamedTuple):
    """What one pass over the model leaves behind: half the sum of squares, gradient ``J'r`` and ``J'J``."""

    cost: Float[Array, ""]
    gradient: Float[Array, " p"]
    normal: Float[Array, "p p"]


def residual_and_jacobian(fn: Callable, y: Float[Array, " p"]) -> tuple[Float[Array, " n"], Float[Array, "n p"]]:
    """Residual and its Jacobian in one pass of forward mode."""

    def twice(q: Array) -> tuple[Array, Array]:
        r = fn(q)
        return r, r

    jacobian, residual = jax.jacfwd(twice, has_aux=True)(y)
    return residual, jacobian


class _State(eqx.Module):
    trial: Float[Array, " p"]
    accepted: Pass
    scale: Float[Array, " p"]
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    predicted: Float[Array, ""]
    status: Int[Array, ""]
    first: Bool[Array, ""]
    remaining: Float[Array, ""]


def _measure(fn: Callable, y: Array, args: PyTree) -> tuple[Pass, Any]:
    residual, jacobian = residual_and_jacobian(lambda q: fn(q, args)[0], y)
    return Pass(residual @ residual / 2, jacobian.T @ residual, jacobian.T @ jacobian), None


def _step(here: Pass, damping: Array, scale: Array, y: Array, lower: Array, upper: Array) -> Array:
    """Least point of the damped model within the box, by an active set.

    A parameter at its bound that the gradient presses outward is held there. Where the step of another one would
    leave the box it ends at the bound, and the remaining ones are solved for again.
    """
    unit = jnp.sqrt(scale)
    gradient, normal = here.gradient / unit, here.normal / (unit[:, None] * unit[None, :])
    damped = normal + damping * jnp.eye(y.size)
    low, high = (lower - y) * unit, (upper - y) * unit
    held = ((low >= 0) & (gradient > 0)) | ((high <= 0) & (gradient < 0)) | (lower == upper)

    def again(state: tuple[Array, Array, Array]) -> Array:
        return state[2]

    def solve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        step, held, _ = state
        known = jnp.where(held, step, 0.0)
        matrix = jnp.where(held[:, None] | held[None, :], jnp.eye(y.size), damped)
        target = jnp.where(held, known, -gradient - damped @ known)
        step = jax.scipy.linalg.solve(matrix, target, assume_a="pos")
        outside = ~held & ((step < low) | (step > high))
        return jnp.clip(step, jnp.minimum(low, 0), jnp.maximum(high, 0)), held | outside, jnp.any(outside)

    begin = (jnp.zeros_like(y), held, jnp.asarray(True))
    return jax.lax.while_loop(again, solve, begin)[0] / unit


class LevenbergMarquardt(optx.AbstractLeastSquaresSolver):
    """Levenberg-Marquardt with Marquardt scaling, Nielsen damping, bounds and a statistical stopping rule.

    Pass ``options={"lower": ..., "upper": ..., "dof": ..., "floor": ...}``: bounds of shape (p,), the degrees of
    freedom, and the sum of squares that rounding alone would leave. The final state's `status` is one of
    `CONVERGED`, `STALLED` (no step makes the fit better, yet the gradient asks for one) and `NOT_FINITE` (the model
    fails at the start).

    Attributes:
        tolerance: largest step left, in standard errors as the scatter of the residuals gives them.
    """

    tolerance: float = 1e-3
    rtol: float = 0.0
    atol: float = 0.0
    norm: Callable = optx.max_norm

    def init(
        self, fn: Callable, y: Array, args: PyTree, options: dict, f_struct: PyTree, aux_struct: PyTree, tags: frozenset
    ) -> _State:
        p = y.shape[0]
        zero, nothing = jnp.zeros(()), Pass(jnp.asarray(jnp.inf), jnp.zeros(p), jnp.full((p, p), jnp.nan))
        status = jnp.asarray(RUNNING)
        return _State(y, nothing, zero * y, zero + _FIRST_DAMPING, zero + 2, zero, status, jnp.asarray(True), zero)

    def step(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: _State, tags: frozenset
    ) -> tuple[Array, _State, Any]:
        there, aux = _measure(fn, state.trial, args)
        finite = jnp.isfinite(there.cost) & jnp.all(jnp.isfinite(there.normal))
        gain = (state.accepted.cost - there.cost) / jnp.where(state.predicted > 0, state.predicted, 1.0)
        accept = finite & (state.first | (gain > 0))
        y = jnp.where(accept, state.trial, y)
        here = jax.tree.map(lambda new, old: jnp.where(accept, new, old), there, state.accepted)
        eased = state.damping * jnp.maximum(1 / 3, 1 - (2 * jnp.clip(gain, 0.0, 1.0) - 1) ** 3)
        damping = jnp.where(state.first, state.damping, jnp.where(accept, eased, state.damping * state.growth))
        growth = jnp.where(accept, 2.0, state.growth * 2)
        scale = jnp.maximum(state.scale, jnp.diag(here.normal))
        return y, self._next(y, here, scale, damping, growth, accept, state, options), aux

    def _next(
        self,
        y: Array,
        here: Pass,
        scale: Array,
        damping: Array,
        growth: Array,
        accept: Array,
        state: _State,
        options: dict,
    ) -> _State:
        """Choose the next trial, or say why there is none."""
        lower, upper = options["lower"], options["upper"]
        units = jnp.where(scale > 0, scale, 1.0)
        trial = jnp.clip(y + _step(here, damping, units, y, lower, upper), lower, upper)
        full = _step(here, jnp.asarray(1e-14), units, y, lower, upper)
        step = trial - y
        predicted = -(here.gradient @ step + step @ here.normal @ step / 2)
        variance = (2 * here.cost + options["floor"]) / options["dof"]
        remaining = full @ here.normal @ full / variance
        near = ~accept & (remaining < _NEAR)
        done = accept & (remaining < self.tolerance**2)
        stuck = (damping > _LARGEST_DAMPING) | jnp.all(trial == y) | ~(predicted > 0)
        status = jnp.where(stuck, STALLED, RUNNING)
        status = jnp.where(done | near | (stuck & (remaining < _NEAR)), CONVERGED, status)
        status = jnp.where(state.first & ~accept, NOT_FINITE, status)
        return _State(trial, here, scale, damping, growth, predicted, status, jnp.asarray(False), remaining)

    def terminate(
        self, fn: Callable, y: Array, args: PyTree, options: dict, state: _State, tags: frozenset
    ) -> tuple[Array, optx.RESULTS]:
        return state.status != RUNNING, optx.RESULTS.successful

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
    ) -> tuple[Array, Any, dict[str, Any]]:
        here = state.accepted
        return (
            y,
            aux,
            {
                "status": state.status,
                "cost": here.cost,
                "normal": here.normal,
                "remaining": state.remaining,
            },
        )
