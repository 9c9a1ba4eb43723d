"""Many fits at once: problems of the same shape as the lanes of one compiled computation.

On a processor the lanes run one after the other in a compiled loop, so that each takes only the steps that it needs;
several such loops run side by side in threads, for a compiled computation holds no lock. On an accelerator the lanes
run abreast, and those that have finished stand still until the others have.
"""

import threading
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..oscillator import starting_state
from .climb import Climbed, Limits, Terrain, climb
from .loss import AbstractLoss
from .problem import Problem
from .residual import Residual
from .settled import Settled, settle
from .solve import finer
from .survey import Survey, survey

WIDTH = 32


class Lane(NamedTuple):
    """The traced part of a problem."""

    condensed: Residual
    residual: Residual
    terrain: tuple[Terrain, ...]
    limits: Limits


class Landed(NamedTuple):
    """Where a lane ended.

    Attributes:
        at: the climb; `survey`: what all samples say there, without the residual itself; `settled`: what it stands for.
        lag_one: autocorrelation of neighbouring residuals.
        half_cycles: number of half-cycles after which the law itself would stop the mass; -1 for never.
    """

    at: Climbed
    survey: Survey
    settled: Settled
    lag_one: Any
    half_cycles: Any


def solve_lanes(problems: Sequence[Problem]) -> list[Landed]:
    """Solve problems for engines that need no mesh; at most `WIDTH` of one shape share a computation."""
    lanes = [Lane(p.condensed, p.residual, p.terrain, p.limits) for p in problems]
    groups: dict[Hashable, list[int]] = {}
    for i, lane in enumerate(lanes):
        groups.setdefault(_shape(lane), []).append(i)
    landed: dict[int, Landed] = {}
    for shape, members in groups.items():
        for first in range(0, len(members), WIDTH):
            chosen = members[first : first + WIDTH]
            found = _abreast([lanes[i] for i in chosen], shape, problems[chosen[0]].loss)
            landed |= {i: jax.tree.map(lambda values, k=k: values[k], found) for k, i in enumerate(chosen)}
    return [landed[i] for i in range(len(problems))]


def _is_array(leaf: object) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray | np.generic)


def _shape(lane: Lane) -> Hashable:
    """What two lanes must have in common to share a computation: structure, settings and shapes of the arrays."""
    leaves, structure = jax.tree.flatten(lane)
    return structure, tuple(np.shape(leaf) if _is_array(leaf) else leaf for leaf in leaves)


_known: set[Hashable] = set()
_compiling = threading.Lock()


def _abreast(lanes: list[Lane], shape: Hashable, loss: AbstractLoss) -> Landed:
    """Solve lanes of one shape; missing ones up to `WIDTH` are copies that are never looked at."""
    filled = lanes + lanes[:1] * (WIDTH - len(lanes))
    arrays, settings = zip(*(eqx.partition(lane, _is_array) for lane in filled), strict=True)
    stacked = jax.tree.map(lambda *values: np.stack(values), *arrays)
    with _compiling:
        # Else several threads would compile the same at once; a run of no lane only compiles.
        if (shape, loss) not in _known:
            jax.block_until_ready(_solve(stacked, settings[0], loss, np.asarray(0)))
            _known.add((shape, loss))
    return jax.tree.map(np.asarray, _solve(stacked, settings[0], loss, np.asarray(len(lanes))))


@eqx.filter_jit
def _solve(stacked: Lane, settings: Lane, loss: AbstractLoss, count: Any) -> Landed:
    def one(arrays: Lane) -> Landed:
        return _land(eqx.combine(arrays, settings), loss)

    def lane(i: Array | int) -> Lane:
        return jax.tree.map(lambda values: values[i], stacked)

    if jax.default_backend() != "cpu":
        return jax.vmap(one)(stacked)
    room = jax.tree.map(lambda leaf: jnp.zeros((WIDTH, *leaf.shape), leaf.dtype), jax.eval_shape(one, lane(0)))
    step = lambda i, results: jax.tree.map(lambda all_, value: all_.at[i].set(value), results, one(lane(i)))
    return jax.lax.fori_loop(0, count, step, room)


def _land(lane: Lane, loss: AbstractLoss) -> Landed:
    """Solve one lane and look at all of its samples."""
    lower, upper = lane.limits.lower, lane.limits.upper
    at = climb(lane.condensed, lane.terrain, lane.limits, loss, jnp.clip(jnp.zeros_like(lower), lower, upper))
    fine = finer(lane.residual)
    y = jnp.concatenate([at.y, jnp.zeros(fine.inputs.shape[0])])
    found, settled = survey(fine, y, loss), settle(fine, y)
    samples = found.residual[: found.residual.size - at.y.size]
    lag = samples[1:] @ samples[:-1] / jnp.where(found.chi2 > 0, found.chi2, 1.0)
    short = found._replace(residual=jnp.zeros(0))
    return Landed(at, short, settled, lag, _own_count(lane.residual, settled))


def _own_count(residual: Residual, settled: Settled) -> Array:
    """Half-cycles after which the law itself would stop the mass; -1 where it never does."""
    if not residual.oscillator.friction.set_valued:
        return jnp.asarray(-1)
    own = residual.own_at(settled.values, 0)
    start = starting_state(settled.machine, own["x0"], own["v0"])
    return residual.engine.solve(settled.machine, start, jnp.zeros(1)).n_half_cycles
