"""Small-sample correction of a covariance for an estimated noise model.

Generalised least squares with an estimated noise model scatter more than with the true one. The computed covariance
scatters too, especially if a record spans few correlation times of the noise. The sensitivity of the estimates to
errors of the noise coefficients adds to their covariance C (Kackar and Harville, J. Am. Stat. Assoc. 79, 853, 1984).
C is too small by the same amount on average, so the term is added twice (Kenward and Roger, Biometrics 53, 983, 1997).
Degrees of freedom describe the uncertainty of C (Satterthwaite, Biometrics Bull. 2, 110, 1946). An estimate divided by
its standard error then follows Student's t with standard deviation sqrt(dof / (dof - 2)) (JCGM 101, 6.4.9).
"""

from collections.abc import Sequence

import numpy as np

from .autoregression import gram
from .colour import Colour, Series, whitened_columns

# Fewest degrees of freedom to use; with two the standard deviation of Student's t is infinite.
_FEWEST = 4.0
# Step for numerical derivatives, in standard errors of the coefficients.
_STEP = 1e-3


def small_sample_covariance(runs: Sequence[tuple[Series, Colour]], covariance: np.ndarray) -> np.ndarray:
    """Return the correction to add to the covariance of the coordinates.

    Args:
        runs: rows of each run and their noise model.
        covariance: of the coordinates for known noise, shape (p, p).
    """
    variance = np.diag(covariance)
    more, scatter = np.zeros_like(covariance), np.zeros(variance.size)
    for series, colour in runs:
        added, slopes = covariance_by_noise(series, colour, covariance)
        more, scatter = more + added, scatter + slopes
    # Two over the degrees of freedom.
    few = np.minimum(np.divide(scatter, variance**2, out=np.zeros(variance.size), where=variance > 0), 2 / _FEWEST)
    wider = 1 / np.sqrt(1 - few)
    return np.outer(wider, wider) * (covariance + 2 * more) - covariance


def covariance_by_noise(series: Series, colour: Colour, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance added by one noise model, and the diagonal's variances.

    With whitened residuals r and functions x, estimates solve ``x'r = 0``. A change of the noise model that changes
    x'r by some amount moves them by -C times that amount, and changes C by -C d(x'x) C.
    """
    p, sides = covariance.shape[0], _sides(series, colour)
    if not sides:
        return np.zeros_like(covariance), np.zeros(p)
    columns = np.column_stack([series.slopes[:, :p], colour.beside])
    white = whitened_columns(columns, series, colour)
    # Project out the other fitted functions.
    away = np.linalg.lstsq(white[:, p:], white[:, :p], rcond=1e-12)[0]
    columns = np.column_stack([columns[:, :p] - columns[:, p:] @ away, colour.left])
    changes = []
    for low, high, errors in sides:
        below, above = (whitened_columns(columns, series, side) for side in (low, high))
        changes.append((above[:, :p].T @ above - below[:, :p].T @ below) / errors)
    moves = [-covariance @ change[:, p] for change in changes]
    slopes = [np.diag(covariance @ change[:, :p] @ covariance) for change in changes]
    # The estimated variance of the innovations also scatters.
    scatter = np.sum(np.square(slopes), axis=0) + 2 / series.t.size * np.diag(covariance) ** 2
    return np.transpose(moves) @ moves, scatter


def _sides(series: Series, colour: Colour) -> list[tuple[Colour, Colour, float]]:
    """Return pairs of perturbed noise models and their distance in standard errors.

    Each pair perturbs one independent direction.
    """
    if colour.sides:
        (weak, quiet), (strong, loud) = colour.sides
        return [(colour._replace(kicks=weak, std=quiet), colour._replace(kicks=strong, std=loud), 2.0)]
    if not colour.coefficients.size:
        return []
    a = colour.coefficients
    steps = _STEP * _directions(series, colour)
    return [(colour._replace(coefficients=a - s), colour._replace(coefficients=a + s), 2 * _STEP) for s in steps]


def _directions(series: Series, colour: Colour) -> np.ndarray:
    """Return independent one-sigma errors of the coefficients, shape (k, order).

    Their covariance is the inverse of the lagged products times the variance of the innovations. For a random walk they
    keep the sum of the coefficients.
    """
    products, _ = gram(colour.left, series.starts, colour.coefficients.size)
    known = colour.std**2 * np.linalg.pinv(products[1:, 1:], hermitian=True)
    if not colour.has_level:
        both = known.sum(axis=0)
        known = known - np.outer(both, both) / both.sum()
    sizes, vectors = np.linalg.eigh(known)
    return (np.sqrt(np.maximum(sizes, 0.0)) * vectors).T
