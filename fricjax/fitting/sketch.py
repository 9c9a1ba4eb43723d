"""A fitted run in few samples, for thumbnails of many runs.

The motion is computed again at the shown samples. Runs share one compiled computation.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..oscillator import Program
from .chunks import in_chunks, width_of
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


class _Asked(NamedTuple):
    """Residual of few samples of weight one, and coordinates."""

    residual: Residual
    y: Float[np.ndarray, " p"]


def sketches(solved: Sequence[tuple[Problem, Solution]], most: int | None = MOST) -> list[Sketch]:
    """Return a sketch of each solved fit, with up to `most` samples.

    The samples are evenly spaced; None selects all of them.
    """
    chosen = [few(problem.windows[0].used.size, most) for problem, _ in solved]
    asked = [_asked(*each, samples, most) for each, samples in zip(solved, chosen, strict=True)]
    meshed = bool(asked) and asked[0].residual.engine.needs_mesh
    # Meshes differ in size, and a chunk that is not full is padded with copies.
    left = [_left(each) for each in asked] if meshed else in_chunks(asked, lambda chunk, _: _all_left(chunk))
    rows = zip(solved, chosen, left, strict=True)
    return [_sketch(problem, solution, samples, np.asarray(part)) for (problem, solution), samples, part in rows]


def few(count: int, most: int | None = MOST) -> np.ndarray:
    """Return indices of at most `most` of `count` samples, including both ends."""
    return np.arange(count) if most is None else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _asked(problem: Problem, solution: Solution, samples: np.ndarray, most: int | None) -> _Asked:
    window, run = problem.windows[0], problem.residual.runs[0]
    size = run.t.size if most is None else most
    # Padded, so that records of any length share a compilation.
    places = np.append(samples, np.full(size - samples.size, samples[-1]))
    t = np.asarray(window.trace.t)[places] - window.origin
    y = solution.y[: problem.residual.n_parameters]
    residual = with_mesh(without_inputs(problem.residual), y)
    x = np.asarray(window.trace.x)[places]
    return _Asked(residual.with_runs(t=[t], x=[x], weight=[np.ones(size)]), y)


def _left_of(asked: _Asked) -> Float[Array, " samples"]:
    """Return model minus measured, without the priors."""
    residual = asked.residual
    return residual(jnp.asarray(asked.y))[: residual.runs[0].t.shape[0]]


def _left_of_all(asked: _Asked) -> Float[Array, "members samples"]:
    """Return the same for several, stacked along a leading axis."""

    def one(i: Array) -> Float[Array, " samples"]:
        return _left_of(jax.tree.map(lambda leaf: leaf[i] if hasattr(leaf, "shape") else leaf, asked))

    return jax.lax.map(one, jnp.arange(width_of(asked)))


_left = Program(_left_of, lambda *_: 0)
_all_left = Program(_left_of_all, lambda *_: 0)


def _sketch(problem: Problem, solution: Solution, samples: np.ndarray, left: np.ndarray) -> Sketch:
    window = problem.windows[0]
    t, x = np.asarray(window.trace.t)[samples], np.asarray(window.trace.x)[samples]
    known = np.asarray(window.trace.mask)[samples]
    at = problem.residual.run_parameters(solution.derived.values, 0)
    computed = known & (t - window.origin >= float(at["t_release"]))
    residual = np.where(computed, -left[: samples.size], np.nan)
    return Sketch(t - float(window.trace.t[0]), np.where(known, x - float(at["offset"]), np.nan), residual)
