"""The way of many starts of one fit to where each ends, through as few compilations as one start needs."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..data.errors import UsageError
from ..oscillator import Smooth
from .climb import FINE, Climbed
from .loss import AbstractLoss, Squares
from .mesh import lengthened, with_mesh
from .problem import Problem
from .residual import Residual, without_inputs
from .solve import NEAR, ROUGH, climb_on, climb_onwards, start_coordinates


class Ended(NamedTuple):
    """Where a start ended: coordinates and values, shape (p,), and the sum of losses, inf where the model failed."""

    y: np.ndarray
    values: np.ndarray
    cost: float


def ended(problems: Sequence[Problem]) -> list[Ended]:
    """Where fits of the same record end that differ in their start values alone."""
    begins = [start_coordinates(problem) for problem in problems]
    residuals = [problem.condensed for problem in problems]
    meshed, robust = isinstance(residuals[0].engine, Smooth), not isinstance(problems[0].loss, Squares)
    # As an array, as in a fit of one start, so that both share a compilation.
    tolerance = np.asarray(NEAR if meshed or robust else FINE)
    ways = _alike([_meshed(r, y, ROUGH if meshed else 1.0) for r, y in zip(residuals, begins, strict=True)])
    ends: list[Any] = [
        None if way is None else climb_on(way, problem.terrain, problem.limits, y, tolerance)
        for way, problem, y in zip(ways, problems, begins, strict=True)
    ]
    if meshed or robust:
        targets = [without_inputs(problem.residual) for problem in problems] if robust else residuals
        again = [None if at is None else _meshed(r, at.y) for r, at in zip(targets, ends, strict=True)]
        ways = _alike(again)
        ends = [
            None if way is None else climb_onwards(way, problem.limits, problem.loss, at)
            for way, problem, at in zip(ways, problems, ends, strict=True)
        ]
    return [_ended(*parts) for parts in zip(problems, ways, ends, begins, strict=True)]


def _meshed(residual: Residual, y: Any, slack: float = 1.0) -> Residual | None:
    """The residual on its mesh; None where the motion from there needs more steps than a mesh can hold."""
    try:
        return with_mesh(residual, y, slack)
    except UsageError:
        return None


def _alike(residuals: Sequence[Residual | None]) -> list[Residual | None]:
    """The same with meshes of one length."""
    known = iter(lengthened([r for r in residuals if r is not None]))
    return [None if r is None else next(known) for r in residuals]


def _ended(problem: Problem, residual: Residual | None, at: Climbed | None, begin: np.ndarray) -> Ended:
    if residual is None or at is None:
        return Ended(begin, np.full(begin.size, np.nan), np.inf)
    y = np.asarray(at.y)
    cost = float(_cost(residual, at.y, problem.loss))
    return Ended(y, np.asarray(residual.values(at.y)), cost if np.isfinite(cost) else np.inf)


@eqx.filter_jit
def _cost(residual: Residual, y: Array, loss: AbstractLoss) -> Array:
    r = residual(y)
    cut = r.size - residual.n_parameters
    return jnp.sum(loss.parts(r[:cut])[0]) + jnp.sum(r[cut:] ** 2)
