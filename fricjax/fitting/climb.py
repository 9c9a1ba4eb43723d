"""The way from the start values to the optimum: windows that grow until they hold everything.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local
minima when the start value of the frequency is off by more than a part of a cycle over the record. So the window is
halved until the motion from the start values is in phase with the record all through it, which the first pass of the
solver tells, and then doubles until it holds the whole moving part; the rest is added last. Start values that keep the
phase need one stage with everything. A robust loss, nearly flat far from its optimum, is led there from that of
squares. All of it is traced, so that many fits can be mapped over; the model stands in it once.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from .levenberg_marquardt import LevenbergMarquardt
from .loss import AbstractLoss, Squares
from .passes import DensePasses
from .residual import Residual
from .status import NOT_FINITE

ROUNDING = 1e-12
FINE = 1e-3
# Part of the moving window at which it is whole, and what stands for the rest as well.
_MOVING, _EVERYTHING = 1.0, 2.0
# How near the optimum of a window is to be met, in standard errors, before the next one.
_ON_THE_WAY = 1.0


class Terrain(eqx.Module):
    """What the windows of a run need to know.

    Attributes:
        moving: weights of the samples without the rest [1/m], shape (samples,).
        tolerance: weighted residual up to which a sample counts as in phase, shape (samples,).
        shortest: shortest window, as a part of the moving one.
    """

    moving: Any
    tolerance: Any
    shortest: Any


class Limits(eqx.Module):
    """Bounds of the coordinates, and those in which the residual is linear, each of shape (p,)."""

    lower: Any
    upper: Any
    linear: Any


class Climbed(NamedTuple):
    """Where the way ended: coordinates, shape (p,), status of the solver, steps and stages."""

    y: Any
    status: Any
    iterations: Any
    stages: Any


class _State(NamedTuple):
    """Where a climb is, how far its window reaches, and whether the start is known to keep the phase that far."""

    at: Climbed
    reach: Array
    kept: Array


def climb(
    residual: Residual,
    terrain: tuple[Terrain, ...],
    limits: Limits,
    y: Float[Array, " p"],
    tolerance: Any = FINE,
) -> Climbed:
    """Least squares from coordinates `y` to within `tolerance` standard errors, in as many stages as it needs."""
    whole = [run.weight for run in residual.runs]
    ends_at_rest = jnp.any(jnp.stack([jnp.any(w != part.moving) for w, part in zip(whole, terrain, strict=True)]))
    full = jnp.where(ends_at_rest, _MOVING, _EVERYTHING)

    def weights(reach: Array) -> list[Array]:
        windows = [_until(run.t, part.moving, reach) for run, part in zip(residual.runs, terrain, strict=True)]
        return [jnp.where(reach >= _EVERYTHING, w, window) for w, window in zip(whole, windows, strict=True)]

    shortest = jnp.min(jnp.stack([jnp.asarray(part.shortest) for part in terrain]))

    def stage(state: _State) -> _State:
        at, reach, kept = state
        windowed, sure = with_weights(residual, weights(reach)), kept | (reach <= shortest)

        def from_in_phase(q: Array, args: None = None) -> Array:
            r = windowed(q)
            strays = (jnp.all(q == at.y) & ~sure) & jnp.any(_out_of_phase(windowed, terrain, r))
            return r + jnp.where(strays, jnp.nan, 0.0)

        near = jnp.where(reach < _EVERYTHING, jnp.maximum(tolerance, _ON_THE_WAY), tolerance)
        found = least_squares(windowed, limits, Squares(), at.y, near, from_in_phase)
        status, steps = found.stats["status"], at.iterations + found.stats["num_steps"]
        further = jnp.where(2 * reach < _MOVING, 2 * reach, full)
        further = jnp.where(reach >= _MOVING, 2 * reach, further)
        onward = _State(Climbed(found.value, status, steps, at.stages + 1), further, jnp.asarray(True))
        shorter = _State(at, jnp.maximum(reach / 2, shortest), jnp.asarray(False))
        lost = ~sure & (status == NOT_FINITE)
        return jax.tree.map(lambda back, on: jnp.where(lost, back, on), shorter, onward)

    none = jnp.asarray(0)
    first = _State(Climbed(y, none, none, none), jnp.asarray(_EVERYTHING), jnp.asarray(False))
    return jax.lax.while_loop(lambda state: state.reach <= _EVERYTHING, stage, first).at


def joined(first: Climbed, then: Climbed) -> Climbed:
    """Two ways, one behind the other."""
    return Climbed(then.y, then.status, first.iterations + then.iterations, first.stages + then.stages)


def onwards(residual: Residual, limits: Limits, loss: AbstractLoss, at: Climbed) -> Climbed:
    """Levenberg-Marquardt from where another residual, or another loss of it, has its optimum."""
    found = least_squares(residual, limits, loss, at.y)
    return Climbed(found.value, found.stats["status"], at.iterations + found.stats["num_steps"], at.stages + 1)


def least_squares(
    residual: Residual,
    limits: Limits,
    loss: AbstractLoss,
    y: Float[Array, " p"],
    tolerance: Any = FINE,
    function: Callable | None = None,
) -> optx.Solution:
    """One run of Levenberg-Marquardt from coordinates `y`, on the residual or a `function` that stands for it."""
    informed = sum(jnp.sum(run.weight > 0) for run in residual.runs) + jnp.sum(residual.prior_weight > 0)
    options = {
        "lower": limits.lower,
        "upper": limits.upper,
        "dof": jnp.maximum(informed - residual.n_parameters, 1) * 1.0,
        "floor": sum(jnp.sum((ROUNDING * run.weight * jnp.max(jnp.abs(run.x))) ** 2) for run in residual.runs),
    }
    if isinstance(loss, Squares):
        options["linear"] = limits.linear
    solver = LevenbergMarquardt(passes=DensePasses(loss=loss, exempt=residual.n_parameters), tolerance=tolerance)
    return optx.least_squares(
        function or residual, solver, y, options=options, max_steps=solver.max_steps + 1, throw=False
    )


def with_weights(residual: Residual, weights: list[Array]) -> Residual:
    """The same residual with other weights of the samples."""
    return eqx.tree_at(lambda r: [run.weight for run in r.runs], residual, weights)


def _until(t: Array, moving: Array, reach: Array) -> Array:
    """Weights of the first part of the moving window of a run."""
    begin, end = _ends(t, moving)
    return jnp.where(t <= begin + jnp.minimum(reach, _MOVING) * (end - begin), moving, 0.0)


def _ends(t: Array, moving: Array) -> tuple[Array, Array]:
    used = moving > 0
    return jnp.min(jnp.where(used, t, jnp.inf)), jnp.max(jnp.where(used, t, -jnp.inf))


def _out_of_phase(residual: Residual, terrain: tuple[Terrain, ...], r: Array) -> Array:
    """Which of the residuals, those of samples in the moving part of a window, are too large for one phase."""
    used = jnp.concatenate(
        [(run.weight > 0) & (part.moving > 0) for run, part in zip(residual.runs, terrain, strict=True)]
    )
    tolerance = jnp.concatenate([jnp.asarray(part.tolerance) for part in terrain])
    return used & ~(jnp.abs(jax.lax.stop_gradient(r[: used.size])) < tolerance)
