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
from jaxtyping import Array, Bool, Float, PyTree

from ..estimation.loss import AbstractLoss, Squares
from ..estimation.passes import AbstractPasses, Pass, gather, residual_and_jacobian
from .residual import Course, Residual, Run

# Condensed records fill one or two of them; a longer chunk would read more samples of no weight.
CHUNK = 512


class Survey(NamedTuple):
    """What a pass over all samples leaves behind.

    Attributes:
        residual: weighted residual of all samples and priors, shape (residuals,).
        chi2: its sum of squares.
        cost: half the sum of losses.
        gradient: J'r, shape (coordinates,), each sample weighted as its loss says.
        normal: J'J, shape (coordinates, coordinates), likewise.
        pulls: size of the spring's force at the turning points of each run, as its path notes them [N].
    """

    residual: Any
    chi2: Any
    cost: Any
    gradient: Any
    normal: Any
    pulls: Any


@eqx.filter_jit
def survey(residual: Residual, y: Float[Array, " coordinates"], loss: AbstractLoss) -> Survey:
    """Residual, gradient and normal matrix at coordinates `y`, from every sample."""
    parts = residual.each(_of_runs(residual, y, loss), residual.runs)
    r, slopes = residual_and_jacobian(residual.priors, y)
    # A prior counts with its square whatever the loss.
    priors = gather(r, slopes, Squares())
    sums = jax.tree.map(lambda *values: sum(values), priors, *(found for _, found, _ in parts))
    joined = jnp.concatenate([*(values for values, _, _ in parts), r])
    return Survey(joined, joined @ joined, sums.cost, sums.gradient, sums.normal, [pulls for _, _, pulls in parts])


class Surveys(AbstractPasses):
    """Passes by surveys of records, which are kept; the function that the solver is given is not asked.

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
        unseen = jax.eval_shape(lambda at: survey(self.residual, at, self.loss), y)
        return super().nothing(y)._replace(kept=jax.tree.map(lambda of: jnp.full(of.shape, jnp.nan), unseen))

    def __call__(self, fn: Callable, y: Float[Array, " coordinates"], args: PyTree) -> Pass:
        found = survey(self.residual, y, self.loss)
        lost = jnp.all(y == self.doubted) & self._astray(found.residual)
        return Pass(jnp.where(lost, jnp.nan, found.cost), found.gradient, found.normal, found)

    def _astray(self, r: Float[Array, " residuals"]) -> Bool[Array, ""]:
        tolerance = jnp.concatenate([jnp.asarray(part) for part in self.tolerance])
        used = jnp.concatenate([run.weight > 0 for run in self.residual.runs])
        return jnp.any(used & ~(jnp.abs(r[: used.size]) < tolerance))


def _of_runs(residual: Residual, y: Array, loss: AbstractLoss) -> Callable[[Any, Run], tuple[Array, Pass, Array]]:
    """What is asked of each run; of several, nothing is asked of one that no sample of which has any weight."""

    def asked(number: Any, run: Run) -> tuple[Array, Pass, Array]:
        return _run(residual, y, number, run, loss)

    def asked_where_seen(number: Any, run: Run) -> tuple[Array, Pass, Array]:
        known = jax.jit(asked)
        of = jax.eval_shape(known, number, run)
        none = lambda: jax.tree.map(lambda each: jnp.zeros(each.shape, each.dtype), of)
        return jax.lax.cond(jnp.any(run.weight > 0), lambda: known(number, run), none)

    return asked if len(residual.runs) == 1 else asked_where_seen


def _run(residual: Residual, y: Array, number: Any, data: Run, loss: AbstractLoss) -> tuple[Array, Pass, Array]:
    """Residual of one run, its sums, and the pulls at its turning points."""
    n = data.t.shape[0]
    pieces = -(-n // CHUNK)
    t, x = (jnp.pad(values, (0, pieces * CHUNK - n), mode="edge") for values in (data.t, data.x))
    weight = jnp.pad(data.weight, (0, pieces * CHUNK - n))

    def course(at: Array) -> tuple[Course, tuple[Course, Course]]:
        moving, fixed = eqx.partition(residual.course(at, number, data), eqx.is_inexact_array)
        return moving, (moving, fixed)

    tangents, (moving, fixed) = jax.jacfwd(course, has_aux=True)(y)

    def chunk(number: Array, so_far: tuple[Array, Pass]) -> tuple[Array, Pass]:
        whole, sums = so_far
        times, seen, used = (jax.lax.dynamic_slice(values, (number * CHUNK,), (CHUNK,)) for values in (t, x, weight))

        def read(at: Course) -> Array:
            return used * (eqx.combine(at, fixed).read(times) - seen)

        r, along = jax.linearize(read, moving)
        columns = jax.vmap(along, in_axes=-1, out_axes=-1)(tangents)
        found = gather(r, columns, loss)
        return jax.lax.dynamic_update_slice(whole, r, (number * CHUNK,)), jax.tree.map(jnp.add, sums, found)

    zero = jnp.zeros(y.shape)
    # Behind the last sample of any weight there is only filling.
    last = jnp.max(jnp.where(weight > 0, jnp.arange(weight.size), -1))
    begin = jnp.zeros(weight.shape), Pass(jnp.zeros(()), zero, zero[:, None] * zero)
    r, sums = jax.lax.fori_loop(0, last // CHUNK + 1, chunk, begin)
    machine, points = residual.machine(y), eqx.combine(moving, fixed).path.turning_points
    return r[:n], sums, jnp.abs(machine.restoring_force(points)) - machine.hysteresis(points)
