"""Evaluation over all samples: residual, gradient and normal matrix, in bounded memory.

The motion and its derivatives along all coordinates are computed once, as a path with tangents. The samples are then
read from it in chunks; each adds its part of ``J'J`` and ``J'r``. So memory for derivatives does not grow with the
number of samples, and chunks without weight at the end are skipped.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from ..estimation.arrays import namespace
from ..estimation.loss import AbstractLoss, Squares
from ..estimation.passes import AbstractPasses, Pass, gather, residual_and_jacobian
from .derived import Derived, derive
from .residual import ObservedMotion, Residual, Run, power

# A condensed record fills one or two chunks; longer chunks would contain more samples without weight.
CHUNK = 512
# Largest number of blocks of a record, least block length, and longest record with one sample per block. Enough blocks
# to show the noise spectrum, few enough to store. Single precision suffices: its error is far below the scatter of the
# noise in a block.
BLOCKS, _LEAST, _SHORT = 16384, 4, 4096


class Block(NamedTuple):
    """Sums over blocks of consecutive samples of a run.

    Attributes:
        residual: weighted residuals multiplied by the influence of the loss, shape (blocks,); `square`: their squares,
            `rough`: squares of their second differences over six, an estimate of their variance if they are white.
        used: number of samples of non-zero weight, shape (blocks,); `curvature`: sum of the curvatures of their losses.
        moved: squared change of the computed reading between samples, in units of the noise.
        slopes: derivatives of `residual` with respect to the coordinates, shape (blocks, coordinates).
    """

    residual: Any
    square: Any
    rough: Any
    used: Any
    curvature: Any
    moved: Any
    slopes: Any

    @classmethod
    def of(cls, sums: np.ndarray) -> "Block":
        """Build from an array with the fields as its columns."""
        n = len(cls._fields) - 1
        return cls(*sums[:, :n].T, slopes=sums[:, n:])


class Evaluation(NamedTuple):
    """Result of an evaluation over all samples.

    Attributes:
        residual: weighted residual of all samples and priors, shape (residuals,).
        chi2: its sum of squares.
        cost: half the sum of losses.
        gradient: J'r, shape (coordinates,), with samples weighted by the loss.
        normal: J'J, shape (coordinates, coordinates), likewise.
        runs: cost, gradient and normal matrix of the samples of each run.
        turning_points: turning points of each run, from its path [m].
        blocks: sums over blocks of samples of each run, the columns of a `Block`, shape (blocks, 6 + coordinates).
    """

    residual: Any
    chi2: Any
    cost: Any
    gradient: Any
    normal: Any
    runs: Any
    turning_points: Any
    blocks: Any


@eqx.filter_jit
def evaluate(residual: Residual, y: Float[Array, " coordinates"], loss: AbstractLoss) -> Evaluation:
    """Return residual, gradient and normal matrix at coordinates `y`, from all samples."""
    parts = residual.each(_of_runs(residual, y, loss), residual.runs)
    if len(parts) > 1:
        parts = [_among_all(residual.directions(i), *part) for i, part in enumerate(parts)]
    r, slopes = residual_and_jacobian(residual.priors, y)
    # The loss of a prior is always its square.
    priors = gather(r, slopes, Squares())
    residuals, passes, points, blocks = zip(*parts, strict=True)
    sums = jax.tree.map(lambda *values: sum(values), priors, *passes)
    joined = jnp.concatenate([*residuals, r])
    return Evaluation(
        joined, joined @ joined, sums.cost, sums.gradient, sums.normal, list(passes), list(points), list(blocks)
    )


class TracedModel(NamedTuple):
    """Model of a residual in traced code, by its engine.

    Attributes:
        residual: the residual.
    """

    residual: Residual

    def evaluate(self, y: Array, weights: Sequence[Array], loss: AbstractLoss) -> Evaluation:
        """Return residual, gradient and normal matrix at coordinates `y`."""
        return evaluate(self.residual.with_runs(weight=weights), y, loss)

    def derive(self, y: Array) -> Derived:
        """Return the physical values for coordinates `y`."""
        return derive(self.residual, y)

    def nothing(self, y: Array, weights: Sequence[Array], loss: AbstractLoss) -> Evaluation:
        """Return the form of no evaluation."""
        unseen = jax.eval_shape(lambda at: self.evaluate(at, weights, loss), y)
        return jax.tree.map(lambda of: jnp.full(of.shape, jnp.nan, of.dtype), unseen)


class EvaluationPasses(AbstractPasses):
    """Objective that evaluates records and keeps each evaluation.

    It ignores the function that the solver passes.

    Attributes:
        model: model of the records and priors: a `TracedModel`, or one with the same methods.
        weights: weights of the samples of each run, shape (samples,).
        loss: loss of the residuals.
        doubted: coordinates that count as failed if the motion there is out of phase; NaN for none.
        tolerance: weighted residual above which a sample is out of phase, shape (samples,) for each run.
    """

    model: Any
    weights: Sequence[Float[Array, " samples"]]
    loss: AbstractLoss
    doubted: Float[Array, " coordinates"]
    tolerance: Sequence[Float[Array, " samples"]]

    def nothing(self, y: Float[Array, " coordinates"]) -> Pass:
        return super().nothing(y)._replace(kept=self.model.nothing(y, self.weights, self.loss))

    def __call__(self, fn: Callable, y: Float[Array, " coordinates"], args: PyTree) -> Pass:
        xp, evaluation = namespace(y), self.model.evaluate(y, self.weights, self.loss)
        lost = xp.all(y == self.doubted) & self._astray(evaluation.residual)
        cost = xp.where(lost, xp.nan, evaluation.cost)
        return Pass(cost, evaluation.gradient, evaluation.normal, evaluation)

    def _astray(self, r: Float[Array, " residuals"]) -> Bool[Array, ""]:
        xp = namespace(r)
        tolerance = xp.concatenate([xp.asarray(part) for part in self.tolerance])
        used = xp.concatenate([weight > 0 for weight in self.weights])
        return xp.any(used & ~(xp.abs(r[: used.size]) < tolerance))


def _of_runs(
    residual: Residual, y: Array, loss: AbstractLoss
) -> Callable[[Any, Run], tuple[Array, Pass, Array, Array]]:
    """Return the function applied to each run; it skips runs without weight.

    A single run is never skipped.
    """

    def evaluate_run(number: Any, run: Run) -> tuple[Array, Pass, Array, Array]:
        return _run(residual, y, number, run, loss)

    def evaluate_weighted_run(number: Any, run: Run) -> tuple[Array, Pass, Array, Array]:
        known = jax.jit(evaluate_run)
        of = jax.eval_shape(known, number, run)
        none = lambda: jax.tree.map(lambda each: jnp.zeros(each.shape, each.dtype), of)
        return jax.lax.cond(jnp.any(run.weight > 0), lambda: known(number, run), none)

    return evaluate_run if len(residual.runs) == 1 else evaluate_weighted_run


def _among_all(
    directions: Array, residual: Array, sums: Pass, points: Array, blocks: Array
) -> tuple[Array, Pass, Array, Array]:
    """Return the results of one run, with sums along all coordinates."""
    few = len(Block._fields) - 1
    slopes = blocks[:, few:] @ directions.astype(blocks.dtype)
    along_all = Pass(sums.cost, sums.gradient @ directions, directions.T @ sums.normal @ directions)
    return residual, along_all, points, jnp.concatenate([blocks[:, :few], slopes], axis=1)


def block_columns(residual: Any, seen: Any, weight: Any, loss: AbstractLoss) -> tuple[Any, ...]:
    """Return the fields of a `Block` except the slopes, for each sample.

    Args:
        residual: weighted residuals of consecutive samples, shape (..., CHUNK).
        seen: displacements [m], same shape.
        weight: weights [1/m], same shape.
        loss: loss of the residuals.
    """
    xp = namespace(residual)
    _, share, curvature = loss.parts(residual)
    counts, influence = (weight > 0) * 1.0, share * residual
    adjacent, reading = counts * xp.roll(counts, 1, axis=-1), seen + residual / xp.where(weight > 0, weight, 1.0)
    step = xp.diff(reading, prepend=reading[..., :1], axis=-1)
    bend = xp.diff(influence, n=2, prepend=influence[..., :1], append=influence[..., -1:], axis=-1)
    inside = (xp.arange(CHUNK) % (CHUNK - 1) > 0) * adjacent * xp.roll(counts, -1, axis=-1)
    rough, moved = inside * bend**2 / 6, adjacent * (weight * step) ** 2
    return influence, influence**2, rough, counts, counts * curvature, moved


def block_length(samples: int) -> int:
    """Return the block length for a padded record of `samples` samples."""
    return 1 if samples <= _SHORT else min(power(-(-samples // BLOCKS), _LEAST), CHUNK)


def _run(residual: Residual, y: Array, number: Any, data: Run, loss: AbstractLoss) -> tuple[Array, Pass, Array, Array]:
    """Return residual, sums, turning points, and blocks of one run.

    Sums are along the directions of this run only: in a joint fit most coordinates belong to other runs.
    """
    n = data.t.shape[0]
    pieces, length = -(-n // CHUNK), block_length(n)
    t, x = (jnp.pad(values, (0, pieces * CHUNK - n), mode="edge") for values in (data.t, data.x))
    weight = jnp.pad(data.weight, (0, pieces * CHUNK - n))

    def observed(at: Array) -> tuple[ObservedMotion, tuple[ObservedMotion, ObservedMotion]]:
        moving, fixed = eqx.partition(residual.observed(at, number, data), eqx.is_inexact_array)
        return moving, (moving, fixed)

    along = lambda direction: jax.jvp(observed, (y,), (direction,), has_aux=True)
    directions = residual.directions(number)
    _, tangents, (moving, fixed) = jax.vmap(along, out_axes=(None, -1, None))(directions)

    def chunk(number: Array, so_far: tuple[Array, Array, Pass]) -> tuple[Array, Array, Pass]:
        residuals, blocks, sums = so_far
        times, seen, used = (jax.lax.dynamic_slice(values, (number * CHUNK,), (CHUNK,)) for values in (t, x, weight))

        def read(at: ObservedMotion) -> Array:
            return used * (eqx.combine(at, fixed).read(times) - seen)

        r, along = jax.linearize(read, moving)
        columns = jax.vmap(along, in_axes=-1, out_axes=-1)(tangents)
        # Both are used many times below; without a barrier XLA computes the motion again for each use.
        r, columns = jax.lax.optimization_barrier((r, columns))
        sums_of_chunk = gather(r, columns, loss)
        columns_of_block = block_columns(r, seen, used, loss)
        curved = columns_of_block[Block._fields.index("curvature")]
        each = jnp.column_stack([*columns_of_block, curved[:, None] * columns])
        summed = each.reshape(-1, length, each.shape[1]).sum(axis=1).astype(jnp.float32)
        return (
            jax.lax.dynamic_update_slice(residuals, r, (number * CHUNK,)),
            jax.lax.dynamic_update_slice(blocks, summed, (number * (CHUNK // length), 0)),
            jax.tree.map(jnp.add, sums, sums_of_chunk),
        )

    zero = jnp.zeros(len(directions))
    # Behind the last sample of non-zero weight there is only padding.
    last = jnp.max(jnp.where(weight > 0, jnp.arange(weight.size), -1))
    begin = (
        jnp.zeros(weight.shape),
        jnp.zeros((weight.size // length, len(Block._fields) - 1 + zero.size), jnp.float32),
        Pass(jnp.zeros(()), zero, zero[:, None] * zero),
    )
    r, blocks, sums = jax.lax.fori_loop(0, last // CHUNK + 1, chunk, begin)
    return r[:n], sums, eqx.combine(moving, fixed).path.turning_points, blocks
