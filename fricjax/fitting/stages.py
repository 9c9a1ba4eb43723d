"""The way from the start values to the optimum: windows that grow until they hold everything.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local
minima when the start value of the frequency is off by more than a part of a cycle over the record. So the window is
halved until the motion from the start values is in phase with the record all through it, which the first pass of the
solver tells. From the optimum of such a window everything is tried again, with half of it, and so on down to a window
twice as long as the last, which one that fits this far is trusted with. Start values that keep the phase need one stage
with everything. A robust loss, nearly flat far from its optimum, is led there from that of
squares. All of it is traced, so that many fits can be mapped over; the model stands in it once.

The same program only looks at where it is, where it is given one step to take: so what checks a fit, and what goes on
from another optimum, is compiled already. Inputs of a rig are looked at only, by a small program.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimation.loss import AbstractLoss, Squares
from ..estimation.passes import Pass
from ..estimation.status import MAX_STEPS, NOT_FINITE
from .derived import Derived, derive
from .evaluation import Evaluation, EvaluationPasses, evaluate
from .residual import Residual

if TYPE_CHECKING:
    import optimistix

ROUNDING = 1e-12
FINE = 1e-3
# Part of the moving window at which it is whole, and what stands for the rest as well.
_MOVING, _EVERYTHING = 1.0, 2.0
# How near the optimum of a window is to be met, in standard errors, before the next one.
_ON_THE_WAY = 1.0


class StageWeights(NamedTuple):
    """What the windows of a run need to know.

    Attributes:
        moving: weights of the samples without the rest [1/m], shape (samples,).
        tolerance: weighted residual up to which a sample counts as in phase, shape (samples,); inf in the rest.
        shortest: shortest window, as a part of the moving one.
    """

    moving: Any
    tolerance: Any
    shortest: Any


class Limits(NamedTuple):
    """Bounds of the coordinates, and those in which the residual is linear, each of shape (p,)."""

    lower: Any
    upper: Any
    linear: Any


class Schedule(NamedTuple):
    """How to go: as arrays, so that every way shares one compilation.

    Attributes:
        tolerance: how near to come to the optimum, in standard errors.
        sure: whether the start is known to keep the phase, so that one stage with everything will do.
        steps: most passes of a stage.
    """

    tolerance: Any = np.asarray(FINE)
    sure: Any = np.asarray(False)
    steps: Any = np.asarray(MAX_STEPS)


CONTINUE = Schedule(sure=np.asarray(True))
# A robust loss is nearly flat far from its optimum: the way from that of squares takes some sixty small steps.
CONTINUE_ROBUST = CONTINUE._replace(steps=np.asarray(4 * MAX_STEPS))
EVALUATE_ONLY = Schedule(sure=np.asarray(True), steps=np.asarray(1))


class Iterate(NamedTuple):
    """Where a way ended.

    Attributes:
        y: coordinates, shape (coordinates,).
        status, iterations, stages: of the solver, and how many it took.
        evaluation: what the samples of the last stage say; its residual and turning points are those of the last pass,
            from which linear coordinates may still have moved.
        derived: what the coordinates stand for.
    """

    y: Any
    status: Any
    iterations: Any
    stages: Any
    evaluation: Evaluation
    derived: Derived


def like_iterate(residual: Residual, *_: Any) -> Iterate:
    """Something of the structure of what :func:`solve_in_stages` returns for a residual."""
    none: Any = 0
    each = [none for _ in residual.runs]
    evaluation = Evaluation(*[none] * 5, runs=[Pass(none, none, none) for _ in each], pulls=each, blocks=each)
    return Iterate(none, none, none, none, evaluation, Derived(none, none, residual.oscillator, none, none))


class _State(NamedTuple):
    """Where the solver is, how far its window reaches, and up to where it is trusted to keep the phase."""

    y: Array
    status: Array
    iterations: Array
    stages: Array
    evaluation: Evaluation
    reach: Array
    trusted: Array


def solve_in_stages(
    residual: Residual,
    stage_weights: tuple[StageWeights, ...],
    limits: Limits,
    loss: AbstractLoss,
    y: Float[Array, " coordinates"],
    way: Schedule,
) -> Iterate:
    """Least squares from coordinates `y`, in as many stages as it needs; with inputs of a rig behind them, only a look.

    Stages would never move these, and a solver of so many coordinates be compiled for nothing.
    """
    none, y = jnp.asarray(0), jnp.asarray(y)
    if residual.inputs.shape[0]:
        return Iterate(y, none, none, none, evaluate(residual, y, loss), derive(residual, y))
    all_weights = [run.weight for run in residual.runs]
    shortest = jnp.min(jnp.stack([jnp.asarray(part.shortest) for part in stage_weights]))

    def weights(reach: Array) -> list[Array]:
        windows = [_until(run.t, part.moving, reach) for run, part in zip(residual.runs, stage_weights, strict=True)]
        return [jnp.where(reach >= _EVERYTHING, w, window) for w, window in zip(all_weights, windows, strict=True)]

    def stage(state: _State) -> _State:
        sure = state.reach <= state.trusted
        near = jnp.where(state.reach < _EVERYTHING, jnp.maximum(way.tolerance, _ON_THE_WAY), way.tolerance)
        passes = EvaluationPasses(
            residual=residual.with_runs(weight=weights(state.reach)),
            loss=loss,
            doubted=jnp.where(sure, jnp.nan, state.y),
            tolerance=[part.tolerance for part in stage_weights],
        )
        optimum = _least_squares(passes, limits, state.y, near, way.steps)
        stats, steps = optimum.stats, state.iterations + optimum.stats["num_steps"]
        seen = stats["kept"]._replace(cost=stats["cost"], gradient=stats["gradient"])
        further = jnp.where(state.reach < _EVERYTHING, _EVERYTHING, jnp.inf)
        onward = _State(optimum.value, stats["status"], steps, state.stages + 1, seen, further, 2 * state.reach)
        shorter = state._replace(reach=jnp.maximum(state.reach / 2, state.trusted))
        lost = ~sure & (stats["status"] == NOT_FINITE)
        return jax.tree.map(lambda back, on: jnp.where(lost, back, on), shorter, onward)

    unseen = EvaluationPasses(residual=residual, loss=loss, doubted=y, tolerance=[]).nothing(y).kept
    trusted = jnp.where(way.sure, _EVERYTHING, shortest)
    first = _State(y, none, none, none, unseen, jnp.asarray(_EVERYTHING), trusted)
    end = jax.lax.while_loop(lambda state: state.reach <= _EVERYTHING, stage, first)
    return Iterate(end.y, end.status, end.iterations, end.stages, end.evaluation, derive(residual, end.y))


def _least_squares(
    passes: EvaluationPasses, limits: Limits, y: Float[Array, " coordinates"], tolerance: Array, steps: Array
) -> "optimistix.Solution":
    """One run of Levenberg-Marquardt from coordinates `y`."""
    # Only who traces it needs the solver: a process that recalls the program is spared half a second of imports.
    import optimistix

    from ..estimation.levenberg_marquardt import LevenbergMarquardt

    residual = passes.residual
    informed = sum(jnp.sum(run.weight > 0) for run in residual.runs) + jnp.sum(residual.prior_weight > 0)
    options = {
        "lower": limits.lower,
        "upper": limits.upper,
        "dof": jnp.maximum(informed - residual.n_parameters, 1) * 1.0,
        "floor": sum(jnp.sum((ROUNDING * run.weight * jnp.max(jnp.abs(run.x))) ** 2) for run in residual.runs),
    }
    if isinstance(passes.loss, Squares):
        options["linear"] = limits.linear & (steps > 1)
    solver = LevenbergMarquardt(passes=passes, max_steps=steps, tolerance=tolerance)
    # The passes know the model; of a function optimistix asks the shape. The solver counts its steps itself.
    return optimistix.least_squares(lambda q, _: q, solver, y, options=options, max_steps=None, throw=False)


def _until(t: Array, moving: Array, reach: Array) -> Array:
    """Weights of the first part of the moving window of a run."""
    used = moving > 0
    begin, end = jnp.min(jnp.where(used, t, jnp.inf)), jnp.max(jnp.where(used, t, -jnp.inf))
    return jnp.where(t <= begin + jnp.minimum(reach, _MOVING) * (end - begin), moving, 0.0)
