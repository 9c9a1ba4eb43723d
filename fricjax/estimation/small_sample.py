"""What it adds to a covariance that the noise is known from the same record only.

Generalised least squares with a process of noise that was estimated from their residuals scatter more than those with
the true one, and the covariance computed with it scatters itself, the more so the fewer correlation times of the noise
a record has. By how much the estimates move with the errors of the coefficients of the process adds to their
covariance C (Kackar and Harville, J. Am. Stat. Assoc. 79, 853, 1984), and as much again makes good that C is too small
by it in the mean (Kenward and Roger, Biometrics 53, 983, 1997). How uncertain C is itself degrees of freedom say
(Satterthwaite, Biometrics Bull. 2, 110, 1946); an estimate over such a standard error is distributed as Student's t,
whose standard deviation is sqrt(dof / (dof - 2)) (JCGM 101, 6.4.9).
"""

from collections.abc import Sequence

import numpy as np

from .autoregression import gram
from .colour import Colour, Series, whitened_columns

# Fewest degrees of freedom that are taken at their word: with two the standard deviation of Student's t is infinite.
_FEWEST = 4.0
# Standard errors of the coefficients over which derivatives are taken.
_STEP = 1e-3


def small_sample_covariance(runs: Sequence[tuple[Series, Colour]], covariance: np.ndarray) -> np.ndarray:
    """What is to be added to the covariance of coordinates that come from runs with the noise seen in them.

    Args:
        runs: rows of each run and their noise.
        covariance: of the coordinates, were the noise known, shape (p, p).
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
    """What the errors of one noise add to a covariance, and the variances that they give its diagonal.

    With the residuals r and the functions x through the filter of the noise, estimates solve ``x'r = 0``: where the
    noise changes x'r they move by -C times as much, and C itself by -C d(x'x) C.
    """
    p, sides = covariance.shape[0], _sides(series, colour)
    if not sides:
        return np.zeros_like(covariance), np.zeros(p)
    columns = np.column_stack([series.slopes[:, :p], colour.beside])
    white = whitened_columns(columns, series, colour)
    # What is fitted besides takes its share of each function.
    away = np.linalg.lstsq(white[:, p:], white[:, :p], rcond=1e-12)[0]
    columns = np.column_stack([columns[:, :p] - columns[:, p:] @ away, colour.left])
    changes = []
    for low, high, errors in sides:
        below, above = (whitened_columns(columns, series, side) for side in (low, high))
        changes.append((above[:, :p].T @ above - below[:, :p].T @ below) / errors)
    moves = [-covariance @ change[:, p] for change in changes]
    slopes = [np.diag(covariance @ change[:, :p] @ covariance) for change in changes]
    # The variance of the innovations scatters besides.
    scatter = np.sum(np.square(slopes), axis=0) + 2 / series.t.size * np.diag(covariance) ** 2
    return np.transpose(moves) @ moves, scatter


def _sides(series: Series, colour: Colour) -> list[tuple[Colour, Colour, float]]:
    """Pairs of what the noise may be as well, in independent directions, and how many standard errors lie between."""
    if colour.sides:
        (weak, quiet), (strong, loud) = colour.sides
        return [(colour._replace(kicks=weak, std=quiet), colour._replace(kicks=strong, std=loud), 2.0)]
    if not colour.coefficients.size:
        return []
    a = colour.coefficients
    steps = _STEP * _directions(series, colour)
    return [(colour._replace(coefficients=a - s), colour._replace(coefficients=a + s), 2 * _STEP) for s in steps]


def _directions(series: Series, colour: Colour) -> np.ndarray:
    """Independent directions in which the coefficients may be off, one standard error each, shape (k, order).

    Their covariance is the inverse of these products over the variance of the innovations. Where the process walks at
    random they keep their sum.
    """
    products, _ = gram(colour.left, series.starts, colour.coefficients.size)
    known = colour.std**2 * np.linalg.pinv(products[1:, 1:], hermitian=True)
    if not colour.has_level:
        both = known.sum(axis=0)
        known = known - np.outer(both, both) / both.sum()
    sizes, vectors = np.linalg.eigh(known)
    return (np.sqrt(np.maximum(sizes, 0.0)) * vectors).T
