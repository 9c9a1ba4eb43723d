"""Noise that is a motion: what random kicks make of a linear system, and least squares that count by it.

Kicks of white acceleration disturb a state, here position and velocity, whose error the system carries on,

    s_i = F_i s_(i-1) + k_i,   n_i = (position in s_i) + u_i,

with white noise u beside it. The innovations of Kalman's filter are independent, and their squares weighted by their
variances are those of generalised least squares (Durbin and Koopman, Time Series Analysis by State Space Methods, 2012,
4.3 and 7.2). The strength of the kicks follows from the residuals by the restricted likelihood, which allows for the
parameters that are fitted with them (Harville, J. Am. Stat. Assoc. 72, 320, 1977).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# The first search covers this many decades to either side of kicks that add as much to the variance of the rows as
# their noise has; each further one covers the two intervals beside the best point of the last, so that three searches
# of 13 points end at intervals of 7 % in the strength.
_DECADES, _POINTS, _SEARCHES = 6.0, 13, 3

# Rows come in so many, which is a part of what is compiled.
_ROWS = 512


class StateTransition(NamedTuple):
    """How a state gets from each row to the next, the first one included.

    Attributes:
        matrix: transition of the state, shape (n, 2, 2).
        noise: covariance that kicks of unit spectral density add on the way, shape (n, 2, 2).
        bend: by what the square of a deviation of the position is to be multiplied for the error of this linear system,
            in each row, shape (n,).
    """

    matrix: np.ndarray
    noise: np.ndarray
    bend: np.ndarray

    @property
    def moving(self) -> int:
        """Number of rows until the last one before which kicks add anything; those behind it are at rest."""
        kicked = np.flatnonzero(self.noise.any(axis=(1, 2)))
        return int(kicked[-1]) + 1 if kicked.size else 0

    def first(self, n: int) -> "StateTransition":
        """That of the first rows."""
        return StateTransition(*(each[:n] for each in self))

    def deviations(self) -> np.ndarray:
        """Variance of the position that kicks of unit spectral density lead to, were nothing measured, shape (n,)."""
        spread, variances = np.zeros((2, 2)), np.empty(self.noise.shape[0])
        for i, (matrix, noise) in enumerate(zip(self.matrix, self.noise, strict=True)):
            spread = matrix @ spread @ matrix.T + noise
            variances[i] = spread[0, 0]
        return variances


class Kicks(NamedTuple):
    """The strength of kicks.

    Attributes:
        kicks: their spectral density over the variance of the noise beside them.
        std: standard deviation of that noise.
        left: the residuals with the parameters fitted anew, shape (n,).
        sizes: of the derivatives that are to be added to the residuals to fit the parameters anew, shape (p,).
        sides: `kicks` and `std` where the kicks are one standard error of their logarithm weaker and stronger.
    """

    kicks: float
    std: float
    left: np.ndarray
    sizes: np.ndarray
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
    n, size = columns.shape[0], -(-columns.shape[0] // _ROWS) * _ROWS
    more = ((0, size - n), (0, 0))
    # Rows of nothing fill up, so that most records share a compilation.
    rows = np.pad(columns, more), np.pad(unit, more[0])
    steps = (np.pad(each, (*more, (0, 0))) for each in (transition.matrix, transition.noise))
    white, variances = _filtered(*rows, *steps, kicks)
    return np.moveaxis(np.asarray(white), 1, 0)[:, :n], np.asarray(variances).T[:, :n]


@jax.jit
def _filtered(columns: Array, unit: Array, matrices: Array, noises: Array, kicks: Array) -> tuple[Array, Array]:
    """The same for all rows at once, shapes (n, k, c) and (n, k).

    Written out by components, for of matrices of two by two a compiler makes calls, each of which costs more than all.
    """
    nothing, alone = jnp.zeros((kicks.size, columns.shape[1])), jnp.zeros(kicks.size)

    def step(state: Any, row: Any) -> Any:
        x, v, xx, xv, vv = state
        read, u, ((a, b), (c, d)), noise = row
        x, v = a * x + b * v, c * x + d * v
        xx, xv, vv = (
            a * a * xx + 2 * a * b * xv + b * b * vv + kicks * noise[0, 0],
            a * c * xx + (a * d + b * c) * xv + b * d * vv + kicks * noise[0, 1],
            c * c * xx + 2 * c * d * xv + d * d * vv + kicks * noise[1, 1],
        )
        variance = u * u * xx + 1.0
        innovation = read - u * x
        of_x, of_v = u * xx / variance, u * xv / variance
        x, v = x + of_x[:, None] * innovation, v + of_v[:, None] * innovation
        xx, xv, vv = xx - of_x * u * xx, xv - of_x * u * xv, vv - of_v * u * xv
        return (x, v, xx, xv, vv), (innovation / jnp.sqrt(variance)[:, None], variance)

    _, innovations = jax.lax.scan(step, (nothing, nothing, alone, alone, alone), (columns, unit, matrices, noises))
    return innovations


def kicks_of(residual: np.ndarray, slopes: np.ndarray, unit: np.ndarray, transition: StateTransition) -> Kicks:
    """How strong kicks are in residuals, whose derivatives are fitted anew beside them."""
    scale = np.maximum(np.sqrt(np.mean(slopes**2, axis=0)), np.finfo(float).tiny)
    columns = np.column_stack([residual, slopes / scale])
    # Kicks that in the mean add as much as the noise has, were nothing measured on the way.
    added = float(unit**2 @ transition.deviations())

    def likelihoods(points: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
        return [_restricted(*pair) for pair in zip(*filtered(columns, unit, transition, points), strict=True)]

    middle, reach = -np.log10(max(added / residual.size, np.finfo(float).tiny)), _DECADES
    kicks, error, best = 0.0, 0.0, (0.0, 0.0, np.zeros(slopes.shape[1]))
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
    _, std, sizes = best
    near = kicks * np.exp([-error, error])
    sides = tuple((float(point), deviation) for point, (_, deviation, *_) in zip(near, likelihoods(near), strict=True))
    return Kicks(kicks, std, residual + columns[:, 1:] @ sizes, sizes / scale, sides)


def _restricted(white: np.ndarray, variances: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Minus twice the restricted log likelihood, deviation of the noise, and sizes of the derivatives."""
    sizes, _, rank, singular = np.linalg.lstsq(white[:, 1:], -white[:, 0], rcond=1e-12)
    dof = max(white.shape[0] - int(rank), 1)
    variance = float(np.sum((white[:, 0] + white[:, 1:] @ sizes) ** 2)) / dof
    information = 2 * float(np.sum(np.log(singular[: int(rank)])))
    spread = float(np.sum(np.log(variances)))
    return dof * np.log(variance) + spread + information, float(np.sqrt(variance)), sizes
