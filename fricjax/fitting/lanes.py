"""Many fits at once: problems of the same shape as the lanes of one compiled computation.

On a processor the lanes run one after the other in a compiled loop, so that each takes only the steps that it needs;
several such loops run side by side in threads, for a compiled computation holds no lock. On an accelerator the lanes
run abreast, and those that have finished stand still until the others have.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..estimation.loss import AbstractLoss, Squares
from ..oscillator import Program
from ..oscillator.program import Shape, of_shape, split
from .derived import Derived
from .diagnostics import typical
from .problem import Problem
from .residual import Residual, start_of, without_inputs
from .runs import full_stage
from .solve import checking, joined, start_coordinates, with_inputs
from .stages import (
    CONTINUE_ROBUST,
    EVALUATE_ONLY,
    Iterate,
    Limits,
    Schedule,
    StageWeights,
    like_iterate,
    solve_in_stages,
)

WIDTH = 32


class Member(NamedTuple):
    """The traced part of one problem: what :func:`~fricjax.fitting.stages.solve_in_stages` takes."""

    residual: Residual
    stage_weights: tuple[StageWeights, ...]
    limits: Limits
    y: Any
    way: Schedule


class Told(NamedTuple):
    """What all samples say where a way has ended.

    Attributes:
        size: typical size of the residuals, in units of the noise.
        half_cycles: number of half-cycles after which the law itself would stop the mass; -1 for never.
    """

    size: Any
    half_cycles: Any


class BatchIterate(NamedTuple):
    """Where a problem ended: the iterate, the evaluation of all samples there without their residual, and its size."""

    at: Iterate
    looked: Iterate
    told: Told


def solve_batch(problems: Sequence[Problem]) -> list[BatchIterate]:
    """Solve problems of one loss, for engines that need no mesh."""
    begins = [Member(p.condensed, p.stage_weights, p.limits, start_coordinates(p), Schedule()) for p in problems]
    ends = [at for at, _ in _gone(begins, Squares())]
    loss = problems[0].loss if problems else Squares()
    if not isinstance(loss, Squares):
        pairs = zip(problems, ends, strict=True)
        further = _gone(
            [_on_all_samples(p, without_inputs(p.residual), at.y, CONTINUE_ROBUST) for p, at in pairs], loss
        )
        ends = [joined(at, then) for at, (then, _) in zip(ends, further, strict=True)]
    targets = [with_inputs(problem.residual, at.y) for problem, at in zip(problems, ends, strict=True)]
    looks = [
        _on_all_samples(p, checking(p.residual, y), y, EVALUATE_ONLY) for p, y in zip(problems, targets, strict=True)
    ]
    return [BatchIterate(at, *found) for at, found in zip(ends, _gone(looks, loss), strict=True)]


def _on_all_samples(problem: Problem, residual: Residual, y: Any, way: Schedule) -> Member:
    return Member(residual, tuple(full_stage(run) for run in residual.runs), problem.limits, y, way)


def _gone(lanes: Sequence[Member], loss: AbstractLoss) -> list[tuple[Iterate, Told]]:
    """Go all ways; at most `WIDTH` of one shape share a computation."""
    parts = [split(lane) for lane in lanes]
    groups: dict[Shape, list[int]] = {}
    for i, (shape, _) in enumerate(parts):
        groups.setdefault(shape, []).append(i)
    gone: dict[int, tuple[Iterate, Told]] = {}
    for shape, members in groups.items():
        for first in range(0, len(members), WIDTH):
            chosen = members[first : first + WIDTH]
            gone |= dict(zip(chosen, _abreast(shape, [parts[i][1] for i in chosen], loss), strict=True))
    return [gone[i] for i in range(len(lanes))]


def _abreast(shape: Shape, lanes: list[list[Any]], loss: AbstractLoss) -> list[tuple[Iterate, Told]]:
    """Go the ways of lanes of one shape; missing ones up to `WIDTH` are copies that are never looked at."""
    columns = zip(*(lanes + lanes[:1] * (WIDTH - len(lanes))), strict=True)
    found = _land_all(of_shape(shape, [np.stack(column) for column in columns]), loss, np.asarray(len(lanes)))
    results, whole = jax.tree.flatten(jax.tree.map(np.asarray, found))
    return [jax.tree.unflatten(whole, [result[i] for result in results]) for i in range(len(lanes))]


def _all_landed(lanes: Member, loss: AbstractLoss, count: Any) -> tuple[Iterate, Told]:
    """What the first `count` lanes tell, one behind the other; their arrays have a leading axis."""

    def one(lane: Member) -> tuple[Iterate, Told]:
        return _land(lane, loss)

    def lane(i: Array | int) -> Member:
        return jax.tree.map(lambda leaf: leaf[i] if eqx.is_array(leaf) else leaf, lanes)

    if jax.default_backend() != "cpu":
        return eqx.filter_vmap(one, in_axes=eqx.if_array(0))(lanes)
    room = jax.tree.map(lambda leaf: jnp.zeros((WIDTH, *leaf.shape), leaf.dtype), eqx.filter_eval_shape(one, lane(0)))
    step = lambda i, results: jax.tree.map(lambda all_, value: all_.at[i].set(value), results, one(lane(i)))
    return jax.lax.fori_loop(0, count, step, room)


_land_all = Program(_all_landed, lambda lanes, *_: (like_iterate(lanes.residual), Told(0, 0)))


def _land(lane: Member, loss: AbstractLoss) -> tuple[Iterate, Told]:
    """Go the way of one lane; what all samples say is told where it only looks."""
    at = solve_in_stages(*lane[:3], loss, *lane[3:])
    found, residual = at.evaluation, lane.residual
    samples = found.residual[: found.residual.size - residual.n_parameters]
    weights = jnp.concatenate([run.weight for run in residual.runs])
    size = typical(jnp.where(weights > 0, samples, jnp.nan), loss, jnp.nanmean, jnp.nanmedian)
    short = at._replace(evaluation=found._replace(residual=jnp.zeros(0)))
    count = jax.lax.cond(lane.way.steps > 1, lambda: jnp.asarray(-1), lambda: _half_cycles_of_law(residual, at.derived))
    return short, Told(size, count)


def _half_cycles_of_law(residual: Residual, derived: Derived) -> Array:
    """Half-cycles after which the law itself would stop the mass; -1 where it never does."""
    if not residual.oscillator.friction.set_valued:
        return jnp.asarray(-1)
    own = residual.run_parameters(derived.values, 0)
    start = start_of(derived.machine, own)
    return residual.engine.solve(derived.machine, start, jnp.zeros(1)).n_half_cycles
