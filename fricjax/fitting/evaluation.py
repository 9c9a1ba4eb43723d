"""One pass over all samples of records: residual, gradient and normal matrix, in bounded memory.

The motion and its derivatives along all coordinates are computed once, as a path with tangents; the samples are then
read off it in chunks, each of which adds its share to ``J'J`` and ``J'r``. So ten million samples need no more memory
for derivatives than ten thousand, and only chunks that hold a sample of some weight are gone through.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from ..estimation.loss import AbstractLoss, Squares
from ..estimation.passes import AbstractPasses, Pass, gather, residual_and_jacobian
from .residual import ObservedMotion, Residual, Run, power

# Condensed records fill one or two of them; a longer chunk would read more samples of no weight.
CHUNK = 512
# Most blocks of a record of any length, and samples in one of a record that has more than those of a chunk times eight:
# enough to show the colour of its noise, few enough to be kept beside its residual, in single precision, which is far
# below the scatter of the noise in a block.
BLOCKS, _LEAST, _SHORT = 16384, 4, 4096


class Block(NamedTuple):
    """Sums over blocks of neighbouring samples of one run, in order; from them follows the noise of the run.

    Attributes:
        residual: weighted residuals, each as much as its loss lets it count, shape (blocks,); `square`: their squares,
            `rough`: squares of their second differences over six, which is their variance if they are white.
        used: number of samples of some weight, shape (blocks,); `curvature`: sum of the curvatures of their losses.
        moved: squares of what the computed reading moves from each sample to the next, in units of the noise.
        slopes: derivatives of `residual` by the coordinates, shape (blocks, coordinates).
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
        """From the columns of such sums."""
        n = len(cls._fields) - 1
        return cls(*sums[:, :n].T, slopes=sums[:, n:])


class Evaluation(NamedTuple):
    """What a pass over all samples leaves behind.

    Attributes:
        residual: weighted residual of all samples and priors, shape (residuals,).
        chi2: its sum of squares.
        cost: half the sum of losses.
        gradient: J'r, shape (coordinates,), each sample weighted as its loss says.
        normal: J'J, shape (coordinates, coordinates), likewise.
        runs: what each run adds to cost, gradient and normal matrix, of the samples alone.
        pulls: size of the spring's force at the turning points of each run, as its path notes them [N].
        blocks: sums over blocks of samples of each run, the columns of a `Block`, shape (blocks, 6 + coordinates).
    """

    residual: Any
    chi2: Any
    cost: Any
    gradient: Any
    normal: Any
    runs: Any
    pulls: Any
    blocks: Any


@eqx.filter_jit
def evaluate(residual: Residual, y: Float[Array, " coordinates"], loss: AbstractLoss) -> Evaluation:
    """Residual, gradient and normal matrix at coordinates `y`, from every sample."""
    parts = residual.each(_of_runs(residual, y, loss), residual.runs)
    if len(parts) > 1:
        parts = [_among_all(residual.directions(i), *part) for i, part in enumerate(parts)]
    r, slopes = residual_and_jacobian(residual.priors, y)
    # A prior counts with its square whatever the loss.
    priors = gather(r, slopes, Squares())
    residuals, passes, pulls, blocks = zip(*parts, strict=True)
    sums = jax.tree.map(lambda *values: sum(values), priors, *passes)
    joined = jnp.concatenate([*residuals, r])
    return Evaluation(
        joined, joined @ joined, sums.cost, sums.gradient, sums.normal, list(passes), list(pulls), list(blocks)
    )


class EvaluationPasses(AbstractPasses):
    """Passes by evaluations of records, which are kept; the function that the solver is passed is not asked.

    Attributes:
        residual: of the records and priors.
        loss: loss of the residuals.
        doubted: coordinates at which a motion that is out of phase is no place to begin; NaN for none.
        tolerance: weighted residual from which a sample is out of phase, shape (samples,) for each run.
    """

    residual: Residual
    loss: AbstractLoss
    doubted: Float[Array, " coordinates"]
    tolerance: Sequence[Float[Array, " samples"]]

    def nothing(self, y: Float[Array, " coordinates"]) -> Pass:
        unseen = jax.eval_shape(lambda at: evaluate(self.residual, at, self.loss), y)
        return super().nothing(y)._replace(kept=jax.tree.map(lambda of: jnp.full(of.shape, jnp.nan, of.dtype), unseen))

    def __call__(self, fn: Callable, y: Float[Array, " coordinates"], args: PyTree) -> Pass:
        evaluation = evaluate(self.residual, y, self.loss)
        lost = jnp.all(y == self.doubted) & self._astray(evaluation.residual)
        return Pass(jnp.where(lost, jnp.nan, evaluation.cost), evaluation.gradient, evaluation.normal, evaluation)

    def _astray(self, r: Float[Array, " residuals"]) -> Bool[Array, ""]:
        tolerance = jnp.concatenate([jnp.asarray(part) for part in self.tolerance])
        used = jnp.concatenate([run.weight > 0 for run in self.residual.runs])
        return jnp.any(used & ~(jnp.abs(r[: used.size]) < tolerance))


def _of_runs(
    residual: Residual, y: Array, loss: AbstractLoss
) -> Callable[[Any, Run], tuple[Array, Pass, Array, Array]]:
    """What is asked of each run; of several, nothing is asked of one that no sample of which has any weight."""

    def asked(number: Any, run: Run) -> tuple[Array, Pass, Array, Array]:
        return _run(residual, y, number, run, loss)

    def asked_where_seen(number: Any, run: Run) -> tuple[Array, Pass, Array, Array]:
        known = jax.jit(asked)
        of = jax.eval_shape(known, number, run)
        none = lambda: jax.tree.map(lambda each: jnp.zeros(each.shape, each.dtype), of)
        return jax.lax.cond(jnp.any(run.weight > 0), lambda: known(number, run), none)

    return asked if len(residual.runs) == 1 else asked_where_seen


def _among_all(
    directions: Array, residual: Array, sums: Pass, pulls: Array, blocks: Array
) -> tuple[Array, Pass, Array, Array]:
    """What is asked of a run, with its sums along all coordinates."""
    few = len(Block._fields) - 1
    slopes = blocks[:, few:] @ directions.astype(blocks.dtype)
    along_all = Pass(sums.cost, sums.gradient @ directions, directions.T @ sums.normal @ directions)
    return residual, along_all, pulls, jnp.concatenate([blocks[:, :few], slopes], axis=1)


def block_length(samples: int) -> int:
    """Samples in a block of a record of so many places."""
    return 1 if samples <= _SHORT else min(power(-(-samples // BLOCKS), _LEAST), CHUNK)


def _run(residual: Residual, y: Array, number: Any, data: Run, loss: AbstractLoss) -> tuple[Array, Pass, Array, Array]:
    """Residual of one run, its sums, the pulls at its turning points, and the sums over its blocks.

    Its sums are those along its own directions alone: of a joint fit of many runs most coordinates move other ones.
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
        # Both are used many times below; without a barrier the motion is computed anew for each.
        r, columns = jax.lax.optimization_barrier((r, columns))
        sums_of_chunk = gather(r, columns, loss)
        _, share, curvature = loss.parts(r)
        counts, influence = (used > 0) * 1.0, share * r
        beside, reading = counts * jnp.roll(counts, 1), seen + r / jnp.where(used > 0, used, 1.0)
        step = jnp.diff(reading, prepend=reading[:1])
        bend = jnp.diff(influence, n=2, prepend=influence[:1], append=influence[-1:])
        inside = (jnp.arange(CHUNK) % (CHUNK - 1) > 0) * beside * jnp.roll(counts, -1)
        rough, moved = inside * bend**2 / 6, beside * (used * step) ** 2
        curved = counts * curvature
        columns_of_block = (influence, influence**2, rough, counts, curved, moved)
        each = jnp.column_stack([*columns_of_block, curved[:, None] * columns])
        summed = each.reshape(-1, length, each.shape[1]).sum(axis=1).astype(jnp.float32)
        return (
            jax.lax.dynamic_update_slice(residuals, r, (number * CHUNK,)),
            jax.lax.dynamic_update_slice(blocks, summed, (number * (CHUNK // length), 0)),
            jax.tree.map(jnp.add, sums, sums_of_chunk),
        )

    zero = jnp.zeros(len(directions))
    # Behind the last sample of any weight there is only filling.
    last = jnp.max(jnp.where(weight > 0, jnp.arange(weight.size), -1))
    begin = (
        jnp.zeros(weight.shape),
        jnp.zeros((weight.size // length, len(Block._fields) - 1 + zero.size), jnp.float32),
        Pass(jnp.zeros(()), zero, zero[:, None] * zero),
    )
    r, blocks, sums = jax.lax.fori_loop(0, last // CHUNK + 1, chunk, begin)
    machine, points = residual.machine(y), eqx.combine(moving, fixed).path.turning_points
    pulls = jnp.abs(machine.restoring_force(points)) - machine.hysteresis(points)
    return r[:n], sums, pulls, blocks
