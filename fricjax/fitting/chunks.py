"""Solve many problems of equal shape in compiled chunks.

A compiled loop solves the problems of a chunk one after the other, so each takes only the steps that it needs. Several
loops run in parallel threads, because compiled computations release the interpreter lock. Fewer problems than a chunk
holds are solved by the program for a single one: compiling the loop takes seconds and saves only milliseconds each.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..data.segmentation.noise import NORMAL_MAD
from ..estimation.loss import AbstractLoss, Squares
from ..oscillator import Program, waiting
from ..oscillator.program import Shape, of_shape, split
from .residual import Residual
from .stages import Iterate, Limits, Schedule, StageWeights, like_iterate, solve_in_stages

# Problems in a chunk. Programs are compiled for this number; a chunk that is not full is padded with copies.
WIDTH = 32
# Largest size of a full chunk [bytes]. Longer records are solved one by one: a record of 1e6 samples takes 25 MB.
_ROOM = 1 << 27


class Member(NamedTuple):
    """Traced arguments of :func:`~fricjax.fitting.stages.solve_in_stages`, without the loss."""

    residual: Residual
    stage_weights: tuple[StageWeights, ...]
    limits: Limits
    y: Any
    schedule: Schedule


def blocks(count: int, parts: int = 1) -> list[range]:
    """Split the numbers below `count` into blocks of similar size.

    A block holds at most a chunk, or a `parts`-th of one. If there are fewer than a chunk holds, each has its own
    block. Otherwise no block holds a single number, which would require another program.
    """
    width = max(WIDTH // parts, 1) if count >= WIDTH else 1
    many = -(-count // width)
    return [range(*ends) for ends in itertools.pairwise(count * i // max(many, 1) for i in range(many + 1))]


def solve_in_chunks(members: Sequence[Member], loss: AbstractLoss) -> list[tuple[Iterate, Any]]:
    """Return the iterate of each problem, and its typical residuals.

    The iterates have no residuals of samples. Typical residuals are those overall and in motion.
    """
    return in_chunks(members, lambda chunk, count: _chunk(chunk, loss, np.asarray(count)))


def in_chunks[M, R](members: Sequence[M], compute: Callable[[M, int], R]) -> list[R]:
    """Apply a function to each of several pytrees, grouped by shape.

    Args:
        members: pytrees of arrays and settings.
        compute: takes `WIDTH` pytrees (a large one alone) stacked along a leading axis, and the number of them to
            compute; the rest is padding. Returns a pytree of arrays with that axis.
    """
    parts = [split(member) for member in members]
    groups: dict[Shape, list[int]] = {}
    for i, (shape, _) in enumerate(parts):
        groups.setdefault(shape, []).append(i)
    results: dict[int, R] = {}
    for shape, numbers in groups.items():
        width = WIDTH if WIDTH * sum(array.nbytes for array in parts[numbers[0]][1]) <= _ROOM else 1
        for first in range(0, len(numbers), width):
            chosen = numbers[first : first + width]
            arrays = [parts[i][1] for i in chosen]
            columns = zip(*(arrays + arrays[:1] * (width - len(arrays))), strict=True)
            stacked = of_shape(shape, [np.stack(column) for column in columns])
            with waiting():
                leaves, structure = jax.tree.flatten(jax.tree.map(np.asarray, compute(stacked, len(chosen))))
            for row, i in enumerate(chosen):
                results[i] = jax.tree.unflatten(structure, [leaf[row] for leaf in leaves])
    return [results[i] for i in range(len(members))]


def width_of(members: Any) -> int:
    """Return the number of stacked pytrees."""
    return next(leaf.shape[0] for leaf in jax.tree.leaves(members) if eqx.is_array(leaf))


def _solve_all(members: Member, loss: AbstractLoss, count: Any) -> tuple[Iterate, Array]:
    """Solve the first `count` of the stacked problems one by one."""

    def one(member: Member) -> tuple[Iterate, Array]:
        return _solve_one(member, loss)

    def member(i: Array | int) -> Member:
        return jax.tree.map(lambda leaf: leaf[i] if eqx.is_array(leaf) else leaf, members)

    width = width_of(members)
    room = jax.tree.map(lambda leaf: jnp.zeros((width, *leaf.shape), leaf.dtype), eqx.filter_eval_shape(one, member(0)))
    step = lambda i, results: jax.tree.map(lambda all_, value: all_.at[i].set(value), results, one(member(i)))
    return jax.lax.fori_loop(0, count, step, room)


_chunk = Program(_solve_all, lambda members, *_: (like_iterate(members.residual), 0))


def _solve_one(member: Member, loss: AbstractLoss) -> tuple[Iterate, Array]:
    """Solve one problem."""
    at = solve_in_stages(*member[:3], loss, *member[3:])
    evaluation, residual = at.evaluation, member.residual
    samples = evaluation.residual[: evaluation.residual.size - residual.n_parameters]
    used = jnp.concatenate([run.weight > 0 for run in residual.runs])
    moving = jnp.concatenate([part.moving > 0 for part in member.stage_weights])
    sizes = typical(samples, used, moving, loss, jnp)
    # Sample residuals of a whole archive would not fit into memory.
    return at._replace(evaluation=evaluation._replace(residual=jnp.zeros(0))), sizes


def typical(residual: Any, used: Any, moving: Any, loss: AbstractLoss, numpy: Any = np) -> Any:
    """Return the typical size of residuals, overall and in motion.

    The shape is (2,). It is the root mean square for least squares, and the scaled median of the absolute values for a
    robust loss.
    """
    parts = numpy.stack([used, moving])
    if isinstance(loss, Squares):
        return numpy.sqrt(numpy.sum(parts * residual**2, axis=1) / numpy.maximum(numpy.sum(parts, axis=1), 1))
    return numpy.nanmedian(numpy.where(parts, abs(residual), numpy.nan), axis=1) / NORMAL_MAD
