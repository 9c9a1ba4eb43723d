"""Covariance of a fit from its normal matrix and uncertain rig inputs.

``J'J``, scaled to a unit diagonal, gives the covariance, the rank and the undetermined directions through its
eigenvalues. An input ``b`` with standard uncertainty ``u(b)`` that is fixed moves the optimum by
``dp/db = -(J'J)^-1 J' dr/db``. Its contribution to the covariance is ``(dp/db) u(b)^2 (dp/db)'`` (JCGM 100, 5.1).
The inputs are coordinates of the residual like the parameters, so ``J' dr/db`` is a block of the same matrix.
"""

from typing import NamedTuple

import numpy as np

WEAKEST = 1e-13
"""Smallest eigenvalue relative to the largest; below it rounding of J'J hides a direction. Also the least damping.
A thousand roundings of double precision."""

COVERAGE = 1.959963984540054
"""Half-width of a 95 % interval in standard errors."""
LIKELIHOOD_DROP = 3.841458820694124
"""Rise of chi^2 at the ends of a 95 % interval: the 95 % point of chi^2 with one degree of freedom."""


class Quadratic(NamedTuple):
    """Quadratic model of chi^2 about a point, in coordinates.

    Attributes:
        inverse: inverse of J'J among the movable and determined parameters, zero elsewhere, shape (p, p).
        step: Gauss-Newton step from the point to the minimum, shape (p,).
        undetermined: parameters along a direction that the record does not determine, shape (p,).
        at_bound: parameters at a bound, shape (p,).
        distance: length of the step in standard errors for unit variance.
    """

    inverse: np.ndarray
    step: np.ndarray
    undetermined: np.ndarray
    at_bound: np.ndarray
    distance: float


def quadratic(gradient: np.ndarray, normal: np.ndarray, at_bound: np.ndarray) -> Quadratic:
    """Build the quadratic model of chi^2 from its gradient and normal matrix."""
    p, movable = normal.shape[0], ~at_bound
    size = np.sqrt(np.where(movable, np.diag(normal), 0.0))
    active = np.flatnonzero((size > 0) & np.isfinite(size))
    inverse, undetermined = np.zeros((p, p)), movable.copy()
    undetermined[active] = False
    if active.size and np.all(np.isfinite(normal[np.ix_(active, active)])):
        # A unit diagonal makes the rank independent of the parameters' units.
        unit = size[active]
        eigenvalues, vectors = np.linalg.eigh(normal[np.ix_(active, active)] / np.outer(unit, unit))
        weak = eigenvalues < WEAKEST * eigenvalues[-1]
        strength = np.where(weak, 0.0, 1 / np.where(weak, 1.0, eigenvalues))
        inverse[np.ix_(active, active)] = (vectors * strength) @ vectors.T / np.outer(unit, unit)
        # A component below a thousandth of a weak direction comes from rounding.
        undetermined[active] = np.any(np.abs(vectors[:, weak]) > 1e-3, axis=1)
    # The gradient is not finite if the model fails; then the distance is not finite either.
    with np.errstate(invalid="ignore"):
        step = -inverse @ gradient
        gain = -(step @ gradient)
    return Quadratic(inverse, step, undetermined, at_bound, float(np.sqrt(max(gain, 0.0))))


class Covariance(NamedTuple):
    """Covariances of the free parameters in their own units, shape (p, p).

    Attributes:
        statistical: from the scatter of the samples.
        combined: with the uncertainty of the rig's inputs.
        contributions: change of each parameter for one standard uncertainty of each input, shape (p, inputs).
        undetermined: parameters along a direction that the record does not determine, shape (p,).
        at_bound: parameters at a bound, shape (p,).
        full_rank: whether every movable direction is determined.
    """

    statistical: np.ndarray
    combined: np.ndarray
    contributions: np.ndarray
    undetermined: np.ndarray
    at_bound: np.ndarray
    full_rank: bool


def covariance(
    shape: Quadratic, slope: np.ndarray, normal: np.ndarray, variance: float, additional: np.ndarray
) -> Covariance:
    """Compute the covariance at the optimum.

    Args:
        shape: quadratic model of chi^2 at the optimum.
        slope: derivative of each value with respect to its coordinate, shape (p,).
        normal: J'J of the parameters followed by the inputs of the rig, shape (p + inputs, p + inputs).
        variance: variance of a residual of unit weight.
        additional: further covariance of the coordinates to add, shape (p, p).
    """
    p = slope.size
    # The matrices of a failed fit may overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        statistical = slope[:, None] * (variance * shape.inverse + additional) * slope
        contributions = -slope[:, None] * (shape.inverse @ normal[:p, p:])
        combined = statistical + contributions @ contributions.T
    # Use inf, since a large finite number could be mistaken for a standard error.
    lost = shape.undetermined | shape.at_bound
    for matrix in (statistical, combined):
        matrix[lost, :] = matrix[:, lost] = 0.0
        matrix[lost, lost] = np.inf
    return Covariance(
        statistical, combined, contributions, shape.undetermined, shape.at_bound, not shape.undetermined.any()
    )


def correlation(matrix: np.ndarray) -> np.ndarray:
    """Return the correlation matrix of a covariance.

    Shape (p, p); NaN for undetermined parameters.
    """
    std = np.sqrt(np.diag(matrix))
    with np.errstate(invalid="ignore"):
        return matrix / np.outer(std, std)
