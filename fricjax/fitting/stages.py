"""Stages of a fit: windows that grow until they contain all samples.

With the number of half-cycles taken from the record the residual has no jumps. But if the start value of the frequency
is off by more than a part of a cycle over the record, the phase causes local minima. So the window is halved until the
motion from the start values is in phase with the record throughout. The first evaluation of the solver tests this. From
the optimum of such a window all samples are tried again, then half of them, and so on, down to a window twice as long
as the last one; a fit of the last window is trusted that far. Start values that keep the phase need one stage with all
samples. A robust loss is nearly flat far from its optimum, so it starts from the optimum of least squares. All of this
is traced, so that it can be mapped over many fits; the model appears once in the program.

With a single step the same program only evaluates the model. So the check of a fit, and its continuation from another
optimum, need no further compilation. Inputs of a rig are evaluated by a separate small program.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ..estimation.arrays import namespace, select, while_loop
from ..estimation.loss import AbstractLoss, Squares
from ..estimation.marquardt import Marquardt
from ..estimation.passes import Pass
from ..estimation.status import MAX_STEPS, NOT_FINITE
from .derived import Derived
from .evaluation import Evaluation, EvaluationPasses, TracedModel
from .residual import Residual
from .tabulate import TabulatedModel
from .window import NEVER

if TYPE_CHECKING:
    pass

ROUNDING = 1e-12
FINE = 1e-3
# Window that contains all samples in motion, and window that contains the rest too.
_MOVING, _EVERYTHING = 1.0, 2.0
# Tolerance of the optimum of a window before the next one, in standard errors.
_ON_THE_WAY = 1.0


class StageWeights(NamedTuple):
    """Weights of a run for the stages.

    Attributes:
        moving: weights of the samples without the rest [1/m], shape (samples,).
        tolerance: largest weighted residual of a sample in phase, shape (samples,); inf in the rest.
        shortest: shortest window, as a part of the moving one.
    """

    moving: Any
    tolerance: Any
    shortest: Any


class Limits(NamedTuple):
    """Bounds of the coordinates, and flags of linear ones, shape (p,)."""

    lower: Any
    upper: Any
    linear: Any


class Schedule(NamedTuple):
    """Options of the solver, as arrays so that all share one compilation.

    Attributes:
        tolerance: tolerance of the optimum, in standard errors.
        sure: True if the start is in phase, so that one stage with all samples suffices.
        steps: largest number of steps in a stage.
    """

    tolerance: Any = np.asarray(FINE)
    sure: Any = np.asarray(False)
    steps: Any = np.asarray(MAX_STEPS)


# Largest number of solves until the number of half-cycles stays.
_ROUNDS = 5
CONTINUE = Schedule(sure=np.asarray(True))
# A robust loss is nearly flat far from its optimum: from that of least squares it takes some sixty small steps.
CONTINUE_ROBUST = CONTINUE._replace(steps=np.asarray(4 * MAX_STEPS))
EVALUATE_ONLY = Schedule(sure=np.asarray(True), steps=np.asarray(1))


class Iterate(NamedTuple):
    """Result of a solve.

    Attributes:
        y: coordinates, shape (coordinates,).
        status, iterations, stages: status of the solver, and numbers of iterations and stages.
        evaluation: evaluation of the samples of the last stage. Its residual and turning points are those of the last
            step; linear coordinates may have moved since.
        derived: physical values for the coordinates.
    """

    y: Any
    status: Any
    iterations: Any
    stages: Any
    evaluation: Evaluation
    derived: Derived


def like_iterate(residual: Residual, *_: Any) -> Iterate:
    """Return an object with the structure of an iterate for a residual."""
    none: Any = 0
    each = [none for _ in residual.runs]
    evaluation = Evaluation(*[none] * 5, runs=[Pass(none, none, none) for _ in each], turning_points=each, blocks=each)
    return Iterate(none, none, none, none, evaluation, Derived(none, none, residual.oscillator, none, none))


class _State(NamedTuple):
    """State of the solver, its window, and the largest trusted window."""

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
    model: Any = None,
) -> Iterate:
    """Solve least squares from coordinates `y`, in as many stages as needed.

    Without a `model` of the residual it is traced, with its engine.

    With inputs of a rig only evaluate: stages would never move these inputs, and a solver for so many coordinates would
    be compiled in vain.
    """
    xp = namespace(y)
    none = xp.asarray(0)
    all_weights = [run.weight for run in residual.runs]
    model = TracedModel(residual) if model is None else model
    if residual.inputs.shape[0]:
        return Iterate(y, none, none, none, model.evaluate(y, all_weights, loss), model.derive(y))
    shortest = xp.min(xp.stack([xp.asarray(part.shortest) for part in stage_weights]))

    def weights(reach: Array) -> list[Array]:
        windows = [_until(run.t, part.moving, reach) for run, part in zip(residual.runs, stage_weights, strict=True)]
        return [xp.where(reach >= _EVERYTHING, w, window) for w, window in zip(all_weights, windows, strict=True)]

    def stage(state: _State) -> _State:
        sure = state.reach <= state.trusted
        near = xp.where(state.reach < _EVERYTHING, xp.maximum(way.tolerance, _ON_THE_WAY), way.tolerance)
        passes = EvaluationPasses(
            model=model,
            weights=weights(state.reach),
            loss=loss,
            doubted=xp.where(sure, xp.nan, state.y),
            tolerance=[part.tolerance for part in stage_weights],
        )
        value, stats = _least_squares(passes, residual, limits, state.y, near, way.steps)
        steps = state.iterations + stats["num_steps"]
        seen = stats["kept"]._replace(cost=stats["cost"], gradient=stats["gradient"])
        further = xp.where(state.reach < _EVERYTHING, _EVERYTHING, xp.inf)
        onward = _State(value, stats["status"], steps, state.stages + 1, seen, further, 2 * state.reach)
        shorter = state._replace(reach=xp.maximum(state.reach / 2, state.trusted))
        return select(xp, ~sure & (stats["status"] == NOT_FINITE), shorter, onward)

    unseen = model.nothing(y, all_weights, loss)
    trusted = xp.where(way.sure, _EVERYTHING, shortest)
    first = _State(y, none, none, none, unseen, xp.asarray(_EVERYTHING), trusted)
    end = while_loop(xp, lambda state: state.reach <= _EVERYTHING, stage, first)
    return Iterate(end.y, end.status, end.iterations, end.stages, end.evaluation, model.derive(end.y))


def solve_on_host(
    residual: Residual,
    stage_weights: tuple[StageWeights, ...],
    limits: Limits,
    loss: AbstractLoss,
    y: Any,
    way: Schedule,
) -> Iterate:
    """Solve by tables of forces on the host, as `solve_in_stages` does.

    The tables of a record that ends in motion have as many half-cycles as the law allows at `y`. The solve is repeated
    until the law allows as many at the optimum.
    """
    # A trial that is not finite is rejected.
    with np.errstate(all="ignore"):
        model = TabulatedModel(residual, y)
        at = solve_in_stages(residual, stage_weights, limits, loss, y, way, model)
        ends_in_motion = any(run.half_cycles >= NEVER for run in residual.runs)
        for _ in range(_ROUNDS if ends_in_motion and way.steps > 1 else 0):
            before = model.half_cycles
            if model.reaches_end or not np.all(np.isfinite(at.y)):
                break
            model = TabulatedModel(residual, at.y)
            if model.half_cycles == before:
                break
            way = CONTINUE._replace(tolerance=way.tolerance)
            then = solve_in_stages(residual, stage_weights, limits, loss, at.y, way, model)
            at = then._replace(iterations=at.iterations + then.iterations, stages=at.stages + then.stages)
        return at


def _least_squares(
    passes: EvaluationPasses,
    residual: Residual,
    limits: Limits,
    y: Float[Array, " coordinates"],
    tolerance: Array,
    steps: Array,
) -> tuple[Array, dict[str, Any]]:
    """Run Levenberg-Marquardt once from coordinates `y`; return the optimum and the statistics."""
    xp, runs = namespace(y), list(zip(residual.runs, passes.weights, strict=True))
    informed = sum(xp.sum(weight > 0) for _, weight in runs) + xp.sum(residual.prior_weight > 0)
    options = {
        "lower": limits.lower,
        "upper": limits.upper,
        "dof": xp.maximum(informed - residual.n_parameters, 1) * 1.0,
        "floor": sum(xp.sum((ROUNDING * weight * xp.max(xp.abs(run.x))) ** 2) for run, weight in runs),
    }
    if isinstance(passes.loss, Squares):
        options["linear"] = limits.linear & (steps > 1)
    if xp is np:
        return Marquardt(passes, steps, tolerance).minimise(y, options)
    # Only tracing needs optimistix; other processes save an import of half a second.
    import optimistix

    from ..estimation.levenberg_marquardt import LevenbergMarquardt

    solver = LevenbergMarquardt(passes=passes, max_steps=steps, tolerance=tolerance)
    # The objective contains the model; optimistix needs only the shape of the function. The solver counts its steps.
    optimum = optimistix.least_squares(lambda q, _: q, solver, y, options=options, max_steps=None, throw=False)
    return optimum.value, optimum.stats


def _until(t: Array, moving: Array, reach: Array) -> Array:
    """Return the weights of the first part of a run's moving window."""
    xp, used = namespace(reach), moving > 0
    begin, end = xp.min(xp.where(used, t, xp.inf)), xp.max(xp.where(used, t, -xp.inf))
    return xp.where(t <= begin + xp.minimum(reach, _MOVING) * (end - begin), moving, 0.0)
