"""Many fits at once: problems of the same shape as the lanes of one compiled computation.

On a processor the lanes run one after the other in a compiled loop, so that each takes only the steps that it needs;
several such loops run side by side in threads, for a compiled computation holds no lock. On an accelerator the lanes
run abreast, and those that have finished stand still until the others have.
"""

import functools
import threading
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .climb import Climbed, Limits, Terrain, climb, onwards
from .loss import AbstractLoss, Squares
from .problem import Problem
from .residual import Residual, Run, start_of, without_inputs
from .runs import filled_to
from .settled import Settled, settle
from .solve import finer
from .survey import Survey, survey
from .verdict import typical

WIDTH = 32


class Lane(NamedTuple):
    """The traced part of a problem; the condensed residual is given by its runs, for it shares the rest."""

    residual: Residual
    condensed: tuple[Run, ...]
    terrain: tuple[Terrain, ...]
    limits: Limits


class Landed(NamedTuple):
    """Where a lane ended.

    Attributes:
        at: the climb; `survey`: what all samples say there, without the residual itself; `settled`: what it stands for.
        lag_one: autocorrelation of neighbouring residuals.
        size: their typical size.
        half_cycles: number of half-cycles after which the law itself would stop the mass; -1 for never.
    """

    at: Climbed
    survey: Survey
    settled: Settled
    lag_one: Any
    size: Any
    half_cycles: Any


def solve_lanes(problems: Sequence[Problem]) -> list[Landed]:
    """Solve problems for engines that need no mesh; at most `WIDTH` of one shape share a computation."""
    longest = max((run.t.size for p in problems for run in p.condensed.runs), default=0)
    lanes = [_Flat.of(Lane(p.residual, *filled_to(longest, p.condensed.runs, p.terrain), p.limits)) for p in problems]
    groups: dict[Hashable, list[int]] = {}
    for i, lane in enumerate(lanes):
        groups.setdefault(lane.shape, []).append(i)
    landed: dict[int, Landed] = {}
    for members in groups.values():
        for first in range(0, len(members), WIDTH):
            chosen = members[first : first + WIDTH]
            found = _abreast([lanes[i] for i in chosen], problems[chosen[0]].loss)
            landed |= dict(zip(chosen, found, strict=True))
    return [landed[i] for i in range(len(problems))]


class _Flat(NamedTuple):
    """A lane taken apart: its arrays, and the shape that it must share with another to share a computation."""

    arrays: list[Any]
    shape: tuple[Any, tuple[Any, ...], tuple[Any, ...]]

    @classmethod
    def of(cls, lane: Lane) -> "_Flat":
        leaves, structure = jax.tree.flatten(lane)
        arrays = [leaf for leaf in leaves if _is_array(leaf)]
        settings = tuple(None if _is_array(leaf) else leaf for leaf in leaves)
        return cls(arrays, (structure, settings, tuple(np.shape(array) for array in arrays)))


def _is_array(leaf: object) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray | np.generic)


_known: set[Hashable] = set()
_compiling = threading.Lock()


def _abreast(lanes: list[_Flat], loss: AbstractLoss) -> list[Landed]:
    """Solve lanes of one shape; missing ones up to `WIDTH` are copies that are never looked at."""
    structure, settings, _ = shape = lanes[0].shape
    filled = lanes + lanes[:1] * (WIDTH - len(lanes))
    rows = [lane.arrays for lane in filled]
    with _compiling:
        # Else several threads would compile the same at once; a run of no lane only compiles.
        if (shape, loss) not in _known:
            jax.block_until_ready(_solve(rows, structure, settings, loss, np.asarray(0)))
            _known.add((shape, loss))
    found = _solve(rows, structure, settings, loss, np.asarray(len(lanes)))
    columns, whole = jax.tree.flatten(jax.tree.map(np.asarray, found))
    return [jax.tree.unflatten(whole, [column[i] for column in columns]) for i in range(len(lanes))]


@functools.partial(jax.jit, static_argnums=(1, 2, 3))
def _solve(rows: list[list[Any]], structure: Any, settings: tuple[Any, ...], loss: AbstractLoss, count: Any) -> Landed:
    def one(arrays: list[Any]) -> Landed:
        rest = iter(arrays)
        leaves = [next(rest) if setting is None else setting for setting in settings]
        return _land(jax.tree.unflatten(structure, leaves), loss)

    stacked = [jnp.stack(column) for column in zip(*rows, strict=True)]

    def lane(i: Array | int) -> list[Any]:
        return [values[i] for values in stacked]

    if jax.default_backend() != "cpu":
        return jax.vmap(one)(stacked)
    room = jax.tree.map(lambda leaf: jnp.zeros((WIDTH, *leaf.shape), leaf.dtype), jax.eval_shape(one, lane(0)))
    step = lambda i, results: jax.tree.map(lambda all_, value: all_.at[i].set(value), results, one(lane(i)))
    return jax.lax.fori_loop(0, count, step, room)


def _land(lane: Lane, loss: AbstractLoss) -> Landed:
    """Solve one lane and look at all of its samples."""
    residual, limits = lane.residual, lane.limits
    bare = without_inputs(residual)
    begin = jnp.clip(jnp.zeros_like(limits.lower), limits.lower, limits.upper)
    at = climb(eqx.tree_at(lambda r: r.runs, bare, lane.condensed), lane.terrain, limits, begin)
    if not isinstance(loss, Squares):
        at = onwards(bare, limits, loss, at)
    fine = finer(residual)
    y = jnp.concatenate([at.y, jnp.zeros(fine.inputs.shape[0])])
    found, settled = survey(fine, y, loss), settle(fine, y)
    samples = found.residual[: found.residual.size - at.y.size]
    lag = samples[1:] @ samples[:-1] / jnp.where(found.chi2 > 0, found.chi2, 1.0)
    weights = jnp.concatenate([run.weight for run in residual.runs])
    size = typical(jnp.where(weights > 0, samples, jnp.nan), loss, jnp.nanmean, jnp.nanmedian)
    short = found._replace(residual=jnp.zeros(0))
    return Landed(at, short, settled, lag, size, _own_count(residual, settled))


def _own_count(residual: Residual, settled: Settled) -> Array:
    """Half-cycles after which the law itself would stop the mass; -1 where it never does."""
    if not residual.oscillator.friction.set_valued:
        return jnp.asarray(-1)
    own = residual.own_at(settled.values, 0)
    start = start_of(settled.machine, own)
    return residual.engine.solve(settled.machine, start, jnp.zeros(1)).n_half_cycles
