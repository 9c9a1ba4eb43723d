"""Noise that is a motion: what random kicks make of a linear system, and least squares that count by it.

Kicks of white acceleration disturb a state, here position and velocity, whose error the system carries on,

    s_i = F_i s_(i-1) + k_i,   n_i = (position in s_i) + u_i,

with white noise u beside it. The innovations of Kalman's filter are independent, and their squares weighted by their
variances are those of generalised least squares (Durbin and Koopman, Time Series Analysis by State Space Methods, 2012,
4.3 and 7.2). The strength of the kicks follows from the residuals by the restricted likelihood, which allows for the
parameters that are fitted with them (Harville, J. Am. Stat. Assoc. 72, 320, 1977).
"""

from typing import NamedTuple

import numpy as np

# The first search covers this many decades to either side of kicks that add as much to the variance of the rows as
# their noise has; each further one covers the two intervals beside the best point of the last, so that three searches
# of 13 points end at intervals of 7 % in the strength.
_DECADES, _POINTS, _SEARCHES = 6.0, 13, 3


class StateTransition(NamedTuple):
    """How a state gets from each row to the next, the first one included.

    Attributes:
        matrix: transition of the state, shape (n, 2, 2).
        noise: covariance that kicks of unit spectral density add on the way, shape (n, 2, 2).
    """

    matrix: np.ndarray
    noise: np.ndarray


class Kicks(NamedTuple):
    """The strength of kicks.

    Attributes:
        kicks: their spectral density over the variance of the noise beside them.
        std: standard deviation of that noise.
        spread: sum of the logarithms of the variances of the innovations over that of the noise.
        left: the residuals with the parameters fitted anew, shape (n,).
        sides: `kicks` and `std` where the kicks are one standard error of their logarithm weaker and stronger.
    """

    kicks: float
    std: float
    spread: float
    left: np.ndarray
    sides: tuple[tuple[float, float], ...]


def filtered(
    columns: np.ndarray, unit: np.ndarray, transition: StateTransition, kicks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Columns of rows through Kalman's filter, and the variances of its innovations, by which they are weighted.

    Args:
        columns: shape (n, c), in units of the noise of a row.
        unit: what a unit of position is in each row, shape (n,).
        transition: of the state, which is zero before the first row.
        kicks: spectral densities of the kicks, shape (k,).

    Returns:
        Innovations over the roots of their variances, shape (k, n, c), and these variances, shape (k, n).
    """
    n, c = columns.shape
    state, spread = np.zeros((kicks.size, 2, c)), np.zeros((kicks.size, 2, 2))
    white, variances = np.empty((kicks.size, n, c)), np.empty((kicks.size, n))
    for i, (matrix, noise) in enumerate(zip(*transition, strict=True)):
        state = matrix @ state
        spread = matrix @ spread @ matrix.T + kicks[:, None, None] * noise
        seen = unit[i] * spread[:, :, 0]
        variance = unit[i] * seen[:, 0] + 1.0
        innovation = columns[i] - unit[i] * state[:, 0]
        gain = seen / variance[:, None]
        state = state + gain[:, :, None] * innovation[:, None, :]
        spread = spread - gain[:, :, None] * seen[:, None, :]
        white[:, i], variances[:, i] = innovation / np.sqrt(variance)[:, None], variance
    return white, variances


def kicks_of(residual: np.ndarray, slopes: np.ndarray, unit: np.ndarray, transition: StateTransition) -> Kicks:
    """How strong kicks are in residuals, whose derivatives are fitted anew beside them."""
    scale = np.maximum(np.sqrt(np.mean(slopes**2, axis=0)), np.finfo(float).tiny)
    columns = np.column_stack([residual, slopes / scale])
    # Kicks that in the mean add as much as the noise has, were nothing measured on the way.
    spread, added = np.zeros((2, 2)), 0.0
    for matrix, noise, each in zip(*transition, unit, strict=True):
        spread = matrix @ spread @ matrix.T + noise
        added += float(each**2 * spread[0, 0])

    def likelihoods(points: np.ndarray) -> list[tuple[float, float, float, np.ndarray]]:
        return [_restricted(*pair) for pair in zip(*filtered(columns, unit, transition, points), strict=True)]

    middle, reach = -np.log10(max(added / residual.size, np.finfo(float).tiny)), _DECADES
    kicks, error, best = 0.0, 0.0, (0.0, 0.0, 0.0, np.zeros(slopes.shape[1]))
    for _ in range(_SEARCHES):
        points = 10.0 ** np.linspace(middle - reach, middle + reach, _POINTS)
        each = likelihoods(points)
        restricted = np.array([likelihood for likelihood, *_ in each])
        k = int(np.argmin(restricted))
        kicks, best, error = float(points[k]), each[k], _DECADES
        if 0 < k < _POINTS - 1:
            # Minus twice the likelihood is a parabola about its least value, of curvature 2 over the squared error.
            bend = float(restricted[k - 1] - 2 * restricted[k] + restricted[k + 1])
            curvature = bend / np.log(points[1] / points[0]) ** 2
            error = min(np.sqrt(2 / max(curvature, np.finfo(float).tiny)), _DECADES)
        middle, reach = float(np.log10(points[k])), 2 * reach / (_POINTS - 1)
    _, std, logarithms, sizes = best
    near = kicks * np.exp([-error, error])
    sides = tuple((float(point), deviation) for point, (_, deviation, *_) in zip(near, likelihoods(near), strict=True))
    return Kicks(kicks, std, logarithms, residual + columns[:, 1:] @ sizes, sides)


def _restricted(white: np.ndarray, variances: np.ndarray) -> tuple[float, float, float, np.ndarray]:
    """Minus twice the restricted log likelihood, deviation of the noise, spread, and sizes of the derivatives."""
    sizes, _, rank, singular = np.linalg.lstsq(white[:, 1:], -white[:, 0], rcond=1e-12)
    dof = max(white.shape[0] - int(rank), 1)
    variance = float(np.sum((white[:, 0] + white[:, 1:] @ sizes) ** 2)) / dof
    information = 2 * float(np.sum(np.log(singular[: int(rank)])))
    spread = float(np.sum(np.log(variances)))
    return dof * np.log(variance) + spread + information, float(np.sqrt(variance)), spread, sizes
