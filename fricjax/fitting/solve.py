"""Solving a posed fit: the moving part first, then everything, then a check against a finer solution.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local
minima when the start value of the frequency is off by more than a part of a cycle over the record. So the window
grows: it begins where the motion from the start values is still in phase with the record, and doubles until it holds
the whole moving part; the rest is added last. The smooth engine gets a new mesh at each stage, and always a last
stage on a mesh made at the optimum.

All this happens on the condensed record. At the optimum all samples are then looked at once, with an engine of clearly
smaller error: the Gauss-Newton step that is left there is what the numerical error of the fit, its condensation
included, has moved the parameters by. Where that is not small against the standard errors, the fit goes on with all
samples and the finer engine.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..oscillator import Smooth
from .levenberg_marquardt import CONVERGED, LevenbergMarquardt
from .mesh import with_mesh
from .problem import Problem
from .quadratic import Quadratic, quadratic
from .residual import Residual, Run
from .survey import Survey, survey
from .window import Window

MAX_PASSES = 60
_IN_PHASE = 0.35
_ACCURATE = 0.1
_ROUNDING = 1e-12


class Solved(NamedTuple):
    """A solved fit.

    Attributes:
        y: coordinates of the parameters and, all zero, of the inputs of the rig.
        survey: residual, gradient and normal matrix there, of all samples and with the finer engine.
        shape: the quadratic form of chi^2 there.
        numerical_shift: the step that is left there in standard errors as the scatter of the residuals gives them, in
            whatever direction it is the longest: how far numerical errors can have moved any parameter.
        status: what the solver said; `out_of_steps` where it ran out of them.
        iterations, passes, stages: steps of Levenberg-Marquardt, passes over the model in all, and stages.
    """

    y: Float[Array, " coordinates"]
    survey: Survey
    shape: Quadratic
    numerical_shift: float
    status: int
    out_of_steps: bool
    iterations: int
    passes: int
    stages: int

    @property
    def chi2(self) -> float:
        return float(self.survey.chi2)

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED and not self.out_of_steps


@eqx.filter_jit
def evaluate(residual: Residual, y: Float[Array, " coordinates"]) -> Float[Array, " residuals"]:
    """The residual at coordinates `y`."""
    return residual(y)


def solve(problem: Problem, y: Float[Array, " coordinates"] | None = None) -> Solved:
    """Fit in stages, each from the optimum of the one before; from given coordinates `y` without growing windows."""
    few = problem.condensed
    at = _start(problem) if y is None else y[: few.n_parameters]
    meshed, checks = with_mesh(few, at), 0
    if y is None:
        stages, checks = _stages(problem, np.asarray(evaluate(with_weights(meshed, problem.moving), at))), 1
    else:
        stages = _parts(problem)
    iterations, last = 0, None
    for number, weights in enumerate(stages):
        meshed = with_mesh(few, at) if number else meshed
        last = _least_squares(with_weights(meshed, weights), problem.lower, problem.upper, at)
        iterations, at = iterations + int(last.stats["num_steps"]), last.value
    assert last is not None
    solved = _checked(problem, problem.residual, last, len(stages), iterations, checks)
    return _refined(problem, solved) if solved.converged and solved.numerical_shift > _ACCURATE else solved


def _refined(problem: Problem, solved: Solved) -> Solved:
    """The fit carried on with all samples and the engine of the check, checked against one finer still."""
    finer = eqx.tree_at(lambda r: r.engine, problem.residual, problem.residual.engine.finer())
    bare = eqx.tree_at(lambda r: r.inputs, finer, finer.inputs[:0])
    at = solved.y[: bare.n_parameters]
    last = _least_squares(with_mesh(bare, at), problem.lower, problem.upper, at)
    iterations = solved.iterations + int(last.stats["num_steps"])
    return _checked(problem, finer, last, solved.stages + 1, iterations, solved.passes - solved.iterations)


def _checked(
    problem: Problem, residual: Residual, last: optx.Solution, stages: int, iterations: int, checks: int
) -> Solved:
    """Look at all samples at the optimum, with an engine finer than that of `residual`."""
    y = jnp.concatenate([last.value, jnp.zeros(residual.inputs.shape[0])])
    fine = eqx.tree_at(lambda r: r.engine, residual, residual.engine.finer())
    found = survey(with_mesh(fine, y), y)
    shape = _shape(problem, np.asarray(last.value), found)
    dof = max(problem.n_used + problem.n_priors - shape.step.size, 1)
    variance = max(float(found.chi2), _rounding(problem)) / dof
    return Solved(
        y=y,
        survey=found,
        shape=shape,
        numerical_shift=shape.distance / float(np.sqrt(variance)),
        status=int(last.stats["status"]),
        out_of_steps=bool(last.result == optx.RESULTS.nonlinear_max_steps_reached),
        iterations=iterations,
        passes=iterations + checks + 1,
        stages=stages,
    )


def _shape(problem: Problem, y: np.ndarray, found: Survey) -> Quadratic:
    p = y.size
    at_bound = (y <= np.asarray(problem.lower)) | (y >= np.asarray(problem.upper))
    return quadratic(np.asarray(found.gradient)[:p], np.asarray(found.normal)[:p, :p], at_bound)


def _start(problem: Problem) -> Float[Array, " coordinates"]:
    return jnp.clip(jnp.zeros(problem.residual.n_parameters), problem.lower, problem.upper)


@eqx.filter_jit
def _least_squares(residual: Residual, lower: Array, upper: Array, y: Float[Array, " p"]) -> optx.Solution:
    """One run of Levenberg-Marquardt from coordinates `y`."""
    informed = sum(jnp.sum(run.weight > 0) for run in residual.runs) + jnp.sum(residual.prior_weight > 0)
    options = {
        "lower": lower,
        "upper": upper,
        "dof": jnp.maximum(informed - residual.n_parameters, 1) * 1.0,
        "floor": sum(jnp.sum((_ROUNDING * run.weight * jnp.max(jnp.abs(run.x))) ** 2) for run in residual.runs),
    }
    return optx.least_squares(residual, LevenbergMarquardt(), y, options=options, max_steps=MAX_PASSES, throw=False)


def _rounding(problem: Problem) -> float:
    """The chi^2 that rounding alone would leave."""
    return sum(float(np.sum((_ROUNDING * run.weight * np.max(np.abs(run.x))) ** 2)) for run in problem.residual.runs)


def with_weights(residual: Residual, weights: tuple[Any, ...]) -> Residual:
    """The same residual with other weights of the samples."""
    return eqx.tree_at(lambda r: [run.weight for run in r.runs], residual, list(weights))
def _stages(problem: Problem, residual: np.ndarray) -> list[tuple[Any, ...]]:
    """Weights of each stage: growing windows over the moving part, then what :func:`_parts` says."""
    reach, stages = min(_in_phase(problem, residual)), []
    while reach < 1:
        stages.append(tuple(_until(problem, i, reach) for i in range(len(problem.windows))))
        reach *= 2
    return [*stages, *_parts(problem)]


def _parts(problem: Problem) -> list[tuple[Any, ...]]:
    """The moving part, then all samples; once where both are the same, but the smooth engine always gets a new mesh."""
    everything = tuple(run.weight for run in problem.condensed.runs)
    two = any(np.any(window.used != window.moving) for window in problem.windows)
    return [problem.moving, everything] if two or isinstance(problem.residual.engine, Smooth) else [everything]


def _until(problem: Problem, run: int, reach: float) -> np.ndarray:
    """Weights of the first part of the moving window of a run."""
    t, weight = np.asarray(problem.condensed.runs[run].t), problem.moving[run]
    begin, end = t[weight > 0][[0, -1]]
    return np.where(t <= begin + reach * (end - begin), weight, 0.0)


def _in_phase(problem: Problem, residual: np.ndarray) -> list[float]:
    """Per run the part of the moving window over which the start values keep the phase, at least four half-cycles."""
    runs = problem.condensed.runs
    ends = np.cumsum([run.t.shape[0] for run in runs])
    parts = np.split(residual, ends)[:-1]
    return [_kept(*entry) for entry in zip(problem.windows, runs, problem.moving, parts, strict=True)]


def _kept(window: Window, run: Run, weight: np.ndarray, residual: np.ndarray) -> float:
    """Part of the moving window of one run over which its start values keep the phase."""
    moving = weight > 0
    t, found = np.asarray(run.t)[moving], window.segmentation
    error = np.abs(residual[moving]) / np.asarray(run.weight)[moving]
    if found.turning_times.size:
        times, points = found.turning_times - window.origin, np.abs(found.turning_points - window.guesses["offset"])
        local = np.interp(t, times, points)
    else:
        local = np.full(t.shape, found.amplitude)
    lost = np.flatnonzero(~(error < _IN_PHASE * np.maximum(local, 0.02 * found.amplitude)))
    span = t[-1] - t[0]
    return 1.0 if not lost.size else max((t[lost[0]] - t[0]) / span, 4 * found.half_period / span)
