"""A fitted run in few samples, for thumbnails of many runs.

The motion is computed again at the shown samples. Runs share one compiled computation.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..oscillator import Program
from .mesh import with_mesh
from .problem import Problem
from .residual import Residual, without_inputs
from .solve import Solution

MOST = 256
"""Samples of a sketch."""


class Sketch(NamedTuple):
    """Samples of a run.

    Attributes:
        t: times from the first sample of the record [s], shape (n,).
        x: reading about the fitted equilibrium, in the unit of the record, shape (n,).
        residual: measured minus model, in the same unit; NaN before the start of the computed motion, and for samples
            without a value.
    """

    t: np.ndarray
    x: np.ndarray
    residual: np.ndarray


def sketch(problem: Problem, solution: Solution, most: int | None = MOST) -> Sketch:
    """Return a sketch of a solved fit, with up to `most` samples.

    The samples are evenly spaced; None selects all of them.
    """
    window, left = problem.windows[0], solution.evaluation.residual
    samples = few(window.used.size, most)
    t, x = np.asarray(window.trace.t)[samples], np.asarray(window.trace.x)[samples]
    known = np.asarray(window.trace.mask)[samples]
    at = problem.residual.run_parameters(solution.derived.values, 0)
    computed = known & (t - window.origin >= float(at["t_release"]))
    # A chunk of runs keeps no residuals of its samples, and no fit keeps those of unused samples.
    if left.size and window.used[samples][computed].all():
        left = left[: window.used.size][samples] * window.sigma[samples]
    else:
        left = _computed(problem, solution, samples, most)
    residual = np.where(computed, -left, np.nan)
    return Sketch(t - float(window.trace.t[0]), np.where(known, x - float(at["offset"]), np.nan), residual)


def few(count: int, most: int | None = MOST) -> np.ndarray:
    """Return indices of at most `most` of `count` samples, including both ends."""
    return np.arange(count) if most is None else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _computed(problem: Problem, solution: Solution, samples: np.ndarray, most: int | None) -> np.ndarray:
    """Return model minus measured at some samples."""
    window, run = problem.windows[0], problem.residual.runs[0]
    size = run.t.size if most is None else most
    # Padded, so that records of any length share a compilation.
    places = np.append(samples, np.full(size - samples.size, samples[-1]))
    t = np.asarray(window.trace.t)[places] - window.origin
    y = solution.y[: problem.residual.n_parameters]
    residual = with_mesh(without_inputs(problem.residual), y)
    x = np.asarray(window.trace.x)[places]
    return np.asarray(_left(residual.with_runs(t=[t], x=[x], weight=[np.ones(size)]), y))[: samples.size]


def _left_of(residual: Residual, y: Float[Array, " p"]) -> Float[Array, " samples"]:
    """Return model minus measured, without the priors."""
    return residual(jnp.asarray(y))[: residual.runs[0].t.shape[0]]


_left = Program(_left_of, lambda *_: 0)
