"""The way from the start values to the optimum: windows that grow until they hold everything.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local
minima when the start value of the frequency is off by more than a part of a cycle over the record. So the window
begins where the motion from the start values is still in phase with the record, and doubles until it holds the whole
moving part; the rest is added last. Start values that keep the phase need one stage with everything. A robust loss,
nearly flat far from its optimum, is led there from that of squares. All of it is traced, so that many fits can be
mapped over.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from .levenberg_marquardt import LevenbergMarquardt
from .loss import AbstractLoss, Squares
from .passes import DensePasses
from .residual import Residual, Run

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
    at: Climbed
    reach: Array


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

    def stage(state: _State) -> _State:
        at, reach = state
        near = jnp.where(reach < _EVERYTHING, jnp.maximum(tolerance, _ON_THE_WAY), tolerance)
        found = least_squares(with_weights(residual, weights(reach)), limits, Squares(), at.y, near)
        steps = at.iterations + found.stats["num_steps"]
        further = jnp.where(2 * reach < _MOVING, 2 * reach, full)
        further = jnp.where(reach >= _MOVING, 2 * reach, further)
        return _State(Climbed(found.value, found.stats["status"], steps, at.stages + 1), further)

    begin = jnp.min(jnp.stack(_in_phase(residual, terrain, y)))
    none = jnp.asarray(0)
    first = _State(Climbed(y, none, none, none), jnp.where((begin >= _MOVING) & (begin < _EVERYTHING), full, begin))
    return jax.lax.while_loop(lambda state: state.reach <= _EVERYTHING, stage, first).at


def joined(first: Climbed, then: Climbed) -> Climbed:
    """Two ways, one behind the other."""
    return Climbed(then.y, then.status, first.iterations + then.iterations, first.stages + then.stages)


def onwards(residual: Residual, limits: Limits, loss: AbstractLoss, at: Climbed) -> Climbed:
    """Levenberg-Marquardt from where another residual, or another loss of it, has its optimum."""
    found = least_squares(residual, limits, loss, at.y)
    return Climbed(found.value, found.stats["status"], at.iterations + found.stats["num_steps"], at.stages + 1)


def least_squares(
    residual: Residual, limits: Limits, loss: AbstractLoss, y: Float[Array, " p"], tolerance: Any = FINE
) -> optx.Solution:
    """One run of Levenberg-Marquardt from coordinates `y`."""
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
    return optx.least_squares(residual, solver, y, options=options, max_steps=solver.max_steps + 1, throw=False)


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


def _in_phase(residual: Residual, terrain: tuple[Terrain, ...], y: Array) -> list[Array]:
    """Per run the part of the moving window over which the start values keep the phase; `_EVERYTHING` where all do."""

    def share(number: Any, run: Run, part: Terrain) -> Array:
        error = jnp.abs(run.weight * (residual.course(y, number, run).read(run.t) - run.x))
        lost = (part.moving > 0) & ~(error < part.tolerance)
        begin, end = _ends(run.t, part.moving)
        first = jnp.min(jnp.where(lost, run.t, jnp.inf))
        share = jnp.clip((first - begin) / (end - begin), part.shortest, _MOVING)
        return jnp.where(jnp.any(lost), share, _EVERYTHING)

    return residual.each(share, residual.runs, terrain)
