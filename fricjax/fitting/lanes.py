"""Many fits at once: problems of the same shape as the lanes of one compiled computation.

On a processor the lanes run one after the other in a compiled loop, so that each takes only the steps that it needs;
several such loops run side by side in threads, for a compiled computation holds no lock. On an accelerator the lanes
run abreast, and those that have finished stand still until the others have.
"""

import functools
import threading
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .climb import LOOK, ONWARDS, Climbed, Limits, Terrain, Way, climb
from .loss import AbstractLoss, Squares
from .problem import Problem
from .residual import Residual, start_of, without_inputs
from .runs import without_windows
from .settled import Settled
from .solve import checking, joined, start_coordinates, with_inputs
from .verdict import typical

WIDTH = 32


class Lane(NamedTuple):
    """The traced part of a way of one problem: what :func:`~fricjax.fitting.climb.climb` takes."""

    residual: Residual
    terrain: tuple[Terrain, ...]
    limits: Limits
    y: Any
    way: Way


class Told(NamedTuple):
    """What all samples say where a way has ended.

    Attributes:
        lag_one: autocorrelation of neighbouring residuals.
        size: their typical size.
        half_cycles: number of half-cycles after which the law itself would stop the mass; -1 for never.
    """

    lag_one: Any
    size: Any
    half_cycles: Any


class Landed(NamedTuple):
    """Where a lane ended: the climb, the look at all samples there, without their residual, and what that tells."""

    at: Climbed
    looked: Climbed
    told: Told


def solve_lanes(problems: Sequence[Problem]) -> list[Landed]:
    """Solve problems of one loss, for engines that need no mesh."""
    begins = [Lane(p.condensed, p.terrain, p.limits, start_coordinates(p), Way()) for p in problems]
    ends = [at for at, _ in _gone(begins, Squares())]
    loss = problems[0].loss if problems else Squares()
    if not isinstance(loss, Squares):
        pairs = zip(problems, ends, strict=True)
        further = _gone([_on_all_samples(p, without_inputs(p.residual), at.y, ONWARDS) for p, at in pairs], loss)
        ends = [joined(at, then) for at, (then, _) in zip(ends, further, strict=True)]
    targets = [with_inputs(problem.residual, at.y) for problem, at in zip(problems, ends, strict=True)]
    looks = [_on_all_samples(p, checking(p.residual, y), y, LOOK) for p, y in zip(problems, targets, strict=True)]
    return [Landed(at, *found) for at, found in zip(ends, _gone(looks, loss), strict=True)]


def _on_all_samples(problem: Problem, residual: Residual, y: Any, way: Way) -> Lane:
    return Lane(residual, tuple(without_windows(run) for run in residual.runs), problem.limits, y, way)


def _gone(lanes: Sequence[Lane], loss: AbstractLoss) -> list[tuple[Climbed, Told]]:
    """Go all ways; at most `WIDTH` of one shape share a computation."""
    flat = [_Flat.of(lane) for lane in lanes]
    groups: dict[Hashable, list[int]] = {}
    for i, lane in enumerate(flat):
        groups.setdefault(lane.shape, []).append(i)
    gone: dict[int, tuple[Climbed, Told]] = {}
    for members in groups.values():
        for first in range(0, len(members), WIDTH):
            chosen = members[first : first + WIDTH]
            gone |= dict(zip(chosen, _abreast([flat[i] for i in chosen], loss), strict=True))
    return [gone[i] for i in range(len(lanes))]


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


def _abreast(lanes: list[_Flat], loss: AbstractLoss) -> list[tuple[Climbed, Told]]:
    """Go the ways of lanes of one shape; missing ones up to `WIDTH` are copies that are never looked at."""
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
def _solve(rows: list[list[Any]], structure: Any, settings: tuple[Any, ...], loss: AbstractLoss, count: Any) -> Any:
    def one(arrays: list[Any]) -> tuple[Climbed, Told]:
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


def _land(lane: Lane, loss: AbstractLoss) -> tuple[Climbed, Told]:
    """Go the way of one lane; what all samples say is told where it only looks."""
    at = climb(*lane[:3], loss, *lane[3:])
    found, residual = at.survey, lane.residual
    samples = found.residual[: found.residual.size - residual.n_parameters]
    lag = samples[1:] @ samples[:-1] / jnp.where(found.chi2 > 0, found.chi2, 1.0)
    weights = jnp.concatenate([run.weight for run in residual.runs])
    size = typical(jnp.where(weights > 0, samples, jnp.nan), loss, jnp.nanmean, jnp.nanmedian)
    short = at._replace(survey=found._replace(residual=jnp.zeros(0)))
    count = jax.lax.cond(lane.way.steps > 1, lambda: jnp.asarray(-1), lambda: _own_count(residual, at.settled))
    return short, Told(lag, size, count)


def _own_count(residual: Residual, settled: Settled) -> Array:
    """Half-cycles after which the law itself would stop the mass; -1 where it never does."""
    if not residual.oscillator.friction.set_valued:
        return jnp.asarray(-1)
    own = residual.own_at(settled.values, 0)
    start = start_of(settled.machine, own)
    return residual.engine.solve(settled.machine, start, jnp.zeros(1)).n_half_cycles
