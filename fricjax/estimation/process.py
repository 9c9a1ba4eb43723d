"""Noise as the response of a linear system to white acceleration.

White accelerations ("kicks", k) disturb a state of position and velocity, and the linear system propagates the error,

    s_i = F_i s_(i-1) + k_i,   n_i = (position in s_i) + u_i,

with independent white noise u. The innovations of the Kalman filter are independent. Weighting their squares by
their variances gives generalised least squares (Durbin and Koopman, Time Series Analysis by State Space Methods, 2012,
4.3 and 7.2). The restricted likelihood of the residuals determines the strength of the kicks; it accounts for the
fitted parameters (Harville, J. Am. Stat. Assoc. 72, 320, 1977).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# The first search covers this many decades to either side of kicks that add as much variance as the noise of the rows.
# Each further search covers the two intervals around the best point, so three searches of 13 points end at intervals
# of 7 % in the strength.
_DECADES, _POINTS, _SEARCHES = 6.0, 13, 3

# Pad to multiples of this many rows so that few shapes are compiled.
_ROWS = 512


class StateTransition(NamedTuple):
    """Transition of the state to each row, including the first.

    Attributes:
        matrix: transition of the state, shape (n, 2, 2).
        noise: covariance added by kicks of unit spectral density, shape (n, 2, 2).
        bend: factor that turns the square of a position deviation into the error of the linearisation, shape (n,).
    """

    matrix: np.ndarray
    noise: np.ndarray
    bend: np.ndarray

    @property
    def moving(self) -> int:
        """Number of rows up to the last with added noise.

        Later rows are at rest.
        """
        kicked = np.flatnonzero(self.noise.any(axis=(1, 2)))
        return int(kicked[-1]) + 1 if kicked.size else 0

    def first(self, n: int) -> "StateTransition":
        """Return the transitions of the first `n` rows."""
        return StateTransition(*(each[:n] for each in self))

    def deviations(self) -> np.ndarray:
        """Return the position variance from kicks of unit spectral density, shape (n,).

        This is the variance without any measurement.
        """
        spread, variances = np.zeros((2, 2)), np.empty(self.noise.shape[0])
        for i, (matrix, noise) in enumerate(zip(self.matrix, self.noise, strict=True)):
            spread = matrix @ spread @ matrix.T + noise
            variances[i] = spread[0, 0]
        return variances


class Kicks(NamedTuple):
    """Strength of the kicks.

    Attributes:
        kicks: spectral density relative to the variance of the independent noise.
        std: standard deviation of the independent noise.
        left: residuals after refitting the parameters, shape (n,).
        sizes: coefficients of the derivatives; adding size times derivative to the residuals refits the parameters,
            shape (p,).
        sides: pairs (`kicks`, `std`) with the log of the kicks one standard error lower and higher.
    """

    kicks: float
    std: float
    left: np.ndarray
    sizes: np.ndarray
    sides: tuple[tuple[float, float], ...]


def filtered(
    columns: np.ndarray, unit: np.ndarray, transition: StateTransition, kicks: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Apply the Kalman filter to columns; return innovations and variances.

    Args:
        columns: shape (n, c), in units of the noise of a row.
        unit: effect of a unit of position on each row, shape (n,).
        transition: of the state, which is zero before the first row.
        kicks: spectral densities of the kicks, shape (k,).

    Returns:
        Innovations divided by their standard deviations, shape (k, n, c), and their variances, shape (k, n).
    """
    n, size = columns.shape[0], -(-columns.shape[0] // _ROWS) * _ROWS
    more = ((0, size - n), (0, 0))
    # Zero padding lets most records share a compiled program.
    rows = np.pad(columns, more), np.pad(unit, more[0])
    steps = (np.pad(each, (*more, (0, 0))) for each in (transition.matrix, transition.noise))
    white, variances = _filtered(*rows, *steps, kicks)
    return np.moveaxis(np.asarray(white), 1, 0)[:, :n], np.asarray(variances).T[:, :n]


@jax.jit
def _filtered(columns: Array, unit: Array, matrices: Array, noises: Array, kicks: Array) -> tuple[Array, Array]:
    """Filter padded rows; shapes (n, k, c) and (n, k).

    The 2x2 algebra is written out by components: a compiled call for each small matrix would cost more than the whole
    arithmetic.
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
    """Estimate the strength of kicks in residuals while refitting the parameters.

    Args:
        residual: shape (n,).
        slopes: derivatives of the residuals with respect to the parameters, shape (n, p).
        unit: effect of a unit of position on each row, shape (n,).
        transition: of the state.
    """
    scale = np.maximum(np.sqrt(np.mean(slopes**2, axis=0)), np.finfo(float).tiny)
    columns = np.column_stack([residual, slopes / scale])
    # Scale of kicks that add on average as much variance as the noise, if no row were measured.
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
            # Minus twice the log likelihood is a parabola near its minimum, of curvature 2 over the squared error.
            bend = float(restricted[k - 1] - 2 * restricted[k] + restricted[k + 1])
            curvature = bend / np.log(points[1] / points[0]) ** 2
            error = min(np.sqrt(2 / max(curvature, np.finfo(float).tiny)), _DECADES)
        middle, reach = float(np.log10(points[k])), 2 * reach / (_POINTS - 1)
    _, std, sizes = best
    near = kicks * np.exp([-error, error])
    sides = tuple((float(point), deviation) for point, (_, deviation, *_) in zip(near, likelihoods(near), strict=True))
    return Kicks(kicks, std, residual + columns[:, 1:] @ sizes, sizes / scale, sides)


def _restricted(white: np.ndarray, variances: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return minus twice the restricted log likelihood, noise deviation and coefficients.

    The coefficients are those of the derivatives, shape (p,).
    """
    sizes, _, rank, singular = np.linalg.lstsq(white[:, 1:], -white[:, 0], rcond=1e-12)
    dof = max(white.shape[0] - int(rank), 1)
    variance = float(np.sum((white[:, 0] + white[:, 1:] @ sizes) ** 2)) / dof
    information = 2 * float(np.sum(np.log(singular[: int(rank)])))
    spread = float(np.sum(np.log(variances)))
    return dof * np.log(variance) + spread + information, float(np.sqrt(variance)), sizes
