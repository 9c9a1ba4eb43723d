"""Covariance of a fit: from the normal matrix at the optimum, and from the uncertain inputs of the rig to first order.

The eigenvalues of ``J'J``, its rows and columns scaled to a unit diagonal, give the covariance, the rank and the
undetermined directions. An input ``b`` with standard uncertainty ``u(b)`` that is held fixed moves the optimum by
``dp/db = -(J'J)^-1 J' dr/db``; its share of the covariance is ``(dp/db) u(b)^2 (dp/db)'`` (JCGM 100, 5.1). The
inputs are coordinates of the residual like the parameters, so ``J' dr/db`` is a block of the same matrix.
"""

from typing import NamedTuple

import numpy as np

from .problem import Problem
from .solve import Solved

RANK_TOLERANCE = 1e-13


class Covariance(NamedTuple):
    """Covariances of the free parameters in their own units, shape (p, p).

    Attributes:
        statistical: from the scatter of the samples.
        combined: with the uncertainty of the rig's inputs.
        undetermined: parameters along a direction that the record does not determine, shape (p,).
        at_bound: parameters held at a bound, shape (p,).
        full_rank: whether every movable direction is determined.
    """

    statistical: np.ndarray
    combined: np.ndarray
    undetermined: np.ndarray
    at_bound: np.ndarray
    full_rank: bool


def covariance(problem: Problem, solved: Solved, variance: float) -> Covariance:
    """Covariance at the optimum; `variance` is the variance of a unit-weight residual."""
    p = problem.residual.n_parameters
    y = np.asarray(solved.y)[:p]
    at_bound = (y <= np.asarray(problem.lower)) | (y >= np.asarray(problem.upper))
    normal = np.asarray(solved.normal)
    inverse, undetermined = _inverse(normal[:p, :p], ~at_bound)
    slope = np.asarray(problem.residual.space.slope(solved.y[:p]))
    statistical = variance * slope[:, None] * inverse * slope
    moved = slope[:, None] * (inverse @ normal[:p, p:])
    combined = statistical + moved @ moved.T
    lost = undetermined | at_bound
    for matrix in (statistical, combined):
        matrix[lost, :] = matrix[:, lost] = 0.0
        matrix[lost, lost] = np.inf
    return Covariance(statistical, combined, undetermined, at_bound, not undetermined.any())


def _inverse(normal: np.ndarray, movable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of the normal matrix among the movable parameters, and which of these it does not determine."""
    p = normal.shape[0]
    size = np.sqrt(np.where(movable, np.diag(normal), 0.0))
    active = np.flatnonzero((size > 0) & np.isfinite(size))
    inverse, undetermined = np.zeros((p, p)), movable.copy()
    undetermined[active] = False
    if active.size and np.all(np.isfinite(normal[np.ix_(active, active)])):
        unit = size[active]
        eigenvalues, vectors = np.linalg.eigh(normal[np.ix_(active, active)] / np.outer(unit, unit))
        weak = eigenvalues < RANK_TOLERANCE * eigenvalues[-1]
        strength = np.where(weak, 0.0, 1 / np.where(weak, 1.0, eigenvalues))
        inverse[np.ix_(active, active)] = (vectors * strength) @ vectors.T / np.outer(unit, unit)
        undetermined[active] = np.any(np.abs(vectors[:, weak]) > 1e-3, axis=1)
    return inverse, undetermined
