"""Solving a posed fit: the moving part first, then everything.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local
minima when the start value of the frequency is off by more than a part of a cycle over the record. So the window
grows: it begins where the motion from the start values is still in phase with the record, and doubles until it holds
the whole moving part; the rest is added last. The smooth engine gets a new mesh at each stage, and always a last
stage on a mesh made at the optimum.
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
from .residual import Residual

MAX_PASSES = 60
_IN_PHASE = 0.35


class Solved(NamedTuple):
    """A solved fit: coordinates, residual and normal matrix there, what the solver said, and what it cost."""

    y: Float[Array, " coordinates"]
    residual: Float[Array, " n"]
    normal: Float[Array, "coordinates coordinates"]
    status: int
    out_of_steps: bool
    iterations: int
    passes: int
    stages: int

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED and not self.out_of_steps


@eqx.filter_jit
def evaluate(residual: Residual, y: Float[Array, " coordinates"]) -> Float[Array, " residuals"]:
    """The residual at coordinates `y`."""
    return residual(y)


def solve(problem: Problem, y: Float[Array, " coordinates"] | None = None) -> Solved:
    """Fit in stages, each from the optimum of the one before; from given coordinates `y` without growing windows."""
    stages = _parts(problem) if y is not None else None
    at = _start(problem) if y is None else y
    iterations, checks, solution, meshed = 0, 1, None, with_mesh(problem.residual, at)
    if stages is None:
        stages, checks = _stages(problem, np.asarray(evaluate(with_weights(meshed, problem.moving), at))), 2
    for number, weights in enumerate(stages):
        meshed = with_mesh(problem.residual, at) if number else meshed
        solution = least_squares(with_weights(meshed, weights), problem, at)
        iterations += int(solution.stats["num_steps"])
        at = solution.value
    assert solution is not None
    stats, out = solution.stats, bool(solution.result == optx.RESULTS.nonlinear_max_steps_reached)
    return Solved(
        y=at,
        residual=evaluate(meshed, at),
        normal=stats["normal"],
        status=int(stats["status"]),
        out_of_steps=out,
        iterations=iterations,
        passes=iterations + checks,
        stages=len(stages),
    )


def _start(problem: Problem) -> Float[Array, " coordinates"]:
    begin = jnp.clip(jnp.zeros(problem.residual.n_parameters), problem.lower, problem.upper)
    return jnp.concatenate([begin, jnp.zeros(problem.residual.inputs.shape[0])])


def least_squares(residual: Residual, problem: Problem, y: Float[Array, " coordinates"]) -> optx.Solution:
    """One run of Levenberg-Marquardt from coordinates `y`; the coordinates of the inputs stay at zero."""
    weights = [run.weight for run in residual.runs]
    floor = sum(
        jnp.sum((1e-12 * w * jnp.max(jnp.abs(run.x))) ** 2) for w, run in zip(weights, residual.runs, strict=True)
    )
    informed = sum(jnp.sum(w > 0) for w in weights) + jnp.sum(residual.prior_weight > 0)
    dof = informed - problem.residual.n_parameters
    still = jnp.zeros(residual.inputs.shape[0])
    options = {
        "lower": jnp.concatenate([problem.lower, still]),
        "upper": jnp.concatenate([problem.upper, still]),
        "dof": jnp.maximum(dof, 1) * 1.0,
        "floor": floor,
    }
    return optx.least_squares(residual, LevenbergMarquardt(), y, options=options, max_steps=MAX_PASSES, throw=False)


def with_weights(residual: Residual, weights: tuple[Any, ...]) -> Residual:
    """The same residual with other weights of the samples."""
    return eqx.tree_at(lambda r: [run.weight for run in r.runs], residual, [jnp.asarray(w) for w in weights])


def _stages(problem: Problem, residual: np.ndarray) -> list[tuple[Any, ...]]:
    """Weights of each stage: growing windows over the moving part, then what :func:`_parts` says."""
    reach, stages = min(_in_phase(problem, residual)), []
    while reach < 1:
        stages.append(tuple(_until(problem, i, reach) for i in range(len(problem.windows))))
        reach *= 2
    return [*stages, *_parts(problem)]


def _parts(problem: Problem) -> list[tuple[Any, ...]]:
    """The moving part, then all samples; once where both are the same, but the smooth engine always gets a new mesh."""
    everything = tuple(run.weight for run in problem.residual.runs)
    two = any(np.any(window.used != window.moving) for window in problem.windows)
    return [problem.moving, everything] if two or isinstance(problem.residual.engine, Smooth) else [everything]


def _until(problem: Problem, run: int, reach: float) -> np.ndarray:
    """Weights of the first part of the moving window of a run."""
    window = problem.windows[run]
    t = np.asarray(window.trace.t)
    begin, end = t[window.moving][[0, -1]]
    return np.where(t <= begin + reach * (end - begin), problem.moving[run], 0.0)


def _in_phase(problem: Problem, residual: np.ndarray) -> list[float]:
    """Per run the part of the moving window over which the start values keep the phase, at least four half-cycles."""
    fractions = []
    for window, r in zip(problem.windows, problem.by_run(residual), strict=True):
        t, found = np.asarray(window.trace.t)[window.moving], window.segmentation
        error = np.abs(r[window.moving]) * window.sigma[window.moving]
        local = (
            np.interp(t, found.turning_times, np.abs(found.turning_points - window.guesses["offset"]))
            if (found.turning_times.size)
            else np.full(t.shape, found.amplitude)
        )
        lost = np.flatnonzero(~(error < _IN_PHASE * np.maximum(local, 0.02 * found.amplitude)))
        span = t[-1] - t[0]
        fractions.append(1.0 if not lost.size else max((t[lost[0]] - t[0]) / span, 4 * found.half_period / span))
    return fractions
