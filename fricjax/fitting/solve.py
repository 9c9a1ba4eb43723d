"""Solving a posed fit: the moving part first, then everything.

With the number of half-cycles taken from the record the residual has no jumps, but the phase still makes local minima when
the start value of the frequency is off by more than a part of a cycle over the record. So the window grows: it begins where
the motion from the start values is still in phase with the record, and doubles until it holds the whole moving part; the
rest is added last.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .levenberg_marquardt import CONVERGED, LevenbergMarquardt, residual_and_jacobian
from .problem import Problem
from .residual import Residual

MAX_PASSES = 60
_IN_PHASE = 0.35


class Solved(NamedTuple):
    """A solved fit: coordinates, residual and Jacobian there, what the solver said, and what it cost."""

    q: Float[Array, " p"]
    residual: Float[Array, " n"]
    jacobian: Float[Array, "n p"]
    status: int
    out_of_steps: bool
    passes: int
    iterations: int

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED and not self.out_of_steps


@eqx.filter_jit
def linearise(residual: Residual, q: Float[Array, " p"]) -> tuple[Array, Array]:
    """Residual and Jacobian at coordinates `q`."""
    return residual_and_jacobian(lambda p: residual(p), q)


def solve(problem: Problem) -> Solved:
    """Fit in stages, each from the optimum of the one before."""
    residual = problem.residual
    q = jnp.clip(jnp.zeros(len(problem.parameters)), problem.lower, problem.upper)
    passes, iterations = 1, 0
    first, _ = linearise(with_weights(residual, problem.moving), q)
    solution = None
    for weights in _stages(problem, np.asarray(first)):
        solution = least_squares(with_weights(residual, weights), problem, q)
        passes += int(solution.stats["num_steps"])
        iterations += 1
        q = solution.value
    assert solution is not None
    r, jacobian = linearise(residual, q)
    out = bool(solution.result == optx.RESULTS.nonlinear_max_steps_reached)
    return Solved(q, r, jacobian, int(solution.stats["status"]), out, passes + 1, iterations)


def least_squares(residual: Residual, problem: Problem, q: Float[Array, " p"]) -> optx.Solution:
    """One run of Levenberg-Marquardt from coordinates `q`."""
    weights = [run.weight for run in residual.runs]
    floor = sum(jnp.sum((1e-12 * w * jnp.max(jnp.abs(run.x))) ** 2) for w, run in zip(weights, residual.runs, strict=True))
    dof = sum(jnp.sum(w > 0) for w in weights) - q.shape[0]
    options = {"lower": problem.lower, "upper": problem.upper, "dof": jnp.maximum(dof, 1) * 1.0, "floor": floor}
    solver = LevenbergMarquardt()
    return optx.least_squares(residual, solver, q, options=options, max_steps=MAX_PASSES, throw=False)


def with_weights(residual: Residual, weights: tuple[Any, ...]) -> Residual:
    """The same residual with other weights of the samples."""
    return eqx.tree_at(lambda r: [run.weight for run in r.runs], residual, [jnp.asarray(w) for w in weights])


def _stages(problem: Problem, residual: np.ndarray) -> list[tuple[Any, ...]]:
    """Weights of each stage: growing windows over the moving part, then all samples."""
    everything = tuple(run.weight for run in problem.residual.runs)
    fractions, stages = _in_phase(problem, residual), []
    reach = min(fractions)
    while reach < 1:
        stages.append(tuple(_until(problem, i, reach) for i in range(len(problem.windows))))
        reach *= 2
    rest = any(np.any(window.used != window.moving) for window in problem.windows)
    return [*stages, *([problem.moving] if rest else []), everything]


def _until(problem: Problem, run: int, reach: float) -> np.ndarray:
    """Weights of the first part of the moving window of a run."""
    window = problem.windows[run]
    t = np.asarray(window.trace.t)
    begin, end = t[window.moving][[0, -1]]
    return np.where(t <= begin + reach * (end - begin), problem.moving[run], 0.0)


def _in_phase(problem: Problem, residual: np.ndarray) -> list[float]:
    """For each run the part of its moving window over which the start values keep the phase (at least four half-cycles)."""
    fractions, first = [], 0
    for window, weight in zip(problem.windows, problem.moving, strict=True):
        r = residual[first : first + weight.size]
        first += weight.size
        t, found = np.asarray(window.trace.t)[window.moving], window.segmentation
        error = np.abs(r[window.moving]) * window.sigma[window.moving]
        local = np.interp(t, found.turning_times, np.abs(found.turning_points - window.guesses["offset"])) if (
            found.turning_times.size
        ) else np.full(t.shape, found.amplitude)
        lost = np.flatnonzero(~(error < _IN_PHASE * np.maximum(local, 0.02 * found.amplitude)))
        span = t[-1] - t[0]
        fractions.append(1.0 if not lost.size else max((t[lost[0]] - t[0]) / span, 4 * found.half_period / span))
    return fractions
