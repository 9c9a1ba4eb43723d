"""The quadratic form of chi^2 at an optimum: its inverse among the parameters that may move, and what is left to go."""

from typing import NamedTuple

import numpy as np

RANK_TOLERANCE = 1e-13


class Quadratic(NamedTuple):
    """Shape of chi^2 about a point, in coordinates.

    Attributes:
        inverse: inverse of J'J among the movable and determined parameters, zero elsewhere, shape (p, p).
        step: Gauss-Newton step from the point to the minimum, shape (p,).
        undetermined: parameters along a direction that the record does not determine, shape (p,).
        at_bound: parameters held at a bound, shape (p,).
        distance: length of the step in units in which a standard error of unit variance is one.
    """

    inverse: np.ndarray
    step: np.ndarray
    undetermined: np.ndarray
    at_bound: np.ndarray
    distance: float


def quadratic(gradient: np.ndarray, normal: np.ndarray, at_bound: np.ndarray) -> Quadratic:
    """Shape of chi^2 where its gradient is `gradient`, with some parameters at a bound."""
    inverse, undetermined = _inverse(normal, ~at_bound)
    # Where the model fails the gradient is not finite, and neither is the distance.
    with np.errstate(invalid="ignore"):
        step = -inverse @ gradient
        gain = -(step @ gradient)
    return Quadratic(inverse, step, undetermined, at_bound, float(np.sqrt(max(gain, 0.0))))


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
