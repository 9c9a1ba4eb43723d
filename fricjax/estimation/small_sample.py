"""What it adds to a covariance that the noise is known from the same record only.

Generalised least squares with a process of noise that was told from their residuals are scattered more than those with
the true one, and the covariance computed with it is itself scattered, the more so the fewer times the noise forgets
within a record. By how much the estimates move with the errors of the coefficients of the process adds to their
covariance C (Kackar and Harville, J. Am. Stat. Assoc. 79, 853, 1984), and as much again makes good that C is too small
by it in the mean (Kenward and Roger, Biometrics 53, 983, 1997). How uncertain C is itself is told by degrees of freedom
(Satterthwaite, Biometrics Bull. 2, 110, 1946); an estimate over such a standard error is distributed as Student's t,
whose standard deviation is sqrt(dof / (dof - 2)) (JCGM 101, 6.4.9).
"""

from collections.abc import Sequence

import numpy as np

from .colour import Colour, Series, gram, innovations

# Fewest degrees of freedom that are believed in: with two the standard deviation of Student's t is infinite.
_FEWEST = 4.0


def unsure(runs: Sequence[tuple[Series, Colour]], covariance: np.ndarray) -> np.ndarray:
    """What is to be added to the covariance of coordinates that come from runs with the noise seen in them.

    Args:
        runs: rows of each run and their noise.
        covariance: of the coordinates, were the noise known, shape (p, p).
    """
    variance = np.diag(covariance)
    more, scatter = np.zeros_like(covariance), np.zeros(variance.size)
    for series, colour in runs:
        if colour.coefficients.size:
            added, slopes = of_a_process(series, colour, covariance)
            more, scatter = more + added, scatter + slopes
    # Two over the degrees of freedom.
    few = np.minimum(np.divide(scatter, variance**2, out=np.zeros(variance.size), where=variance > 0), 2 / _FEWEST)
    wider = 1 / np.sqrt(1 - few)
    return np.outer(wider, wider) * (covariance + 2 * more) - covariance


def of_a_process(series: Series, colour: Colour, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the errors of one process add to a covariance, and the variances that they give its diagonal.

    With the residuals r, functions x, and both through the filter A of the process, estimates solve ``(A x)'A r = 0``:
    a change of ``a_k``, and so of A by ``L^k``, moves them by ``C ((L^k x)'A r + (A x)'L^k r)``.
    """
    a, std, p = colour.coefficients, colour.std, covariance.shape[0]
    columns = np.column_stack([series.slopes[:, :p], colour.beside])
    white = innovations(columns, series.starts, a)
    # What is fitted besides takes its share of each function.
    away = np.linalg.lstsq(white[:, p:], white[:, :p], rcond=1e-12)[0]
    columns = np.column_stack([columns[:, :p] - columns[:, p:] @ away, colour.left])
    white, before = innovations(columns, series.starts, a), _before(columns, series.starts, a.size)
    along = np.einsum("kmi,mj->kij", before[..., :p], white, optimize=True)
    across = np.einsum("mi,km->ki", white[:, :p], before[..., p], optimize=True)
    moves = (along[..., p] + across) @ covariance / std**2
    # Coefficients are as uncertain as the inverse of these products tells, over the variance of the innovations.
    products, n = gram(colour.left, series.starts, a.size)
    known = std**2 * np.linalg.pinv(products[1:, 1:], hermitian=True)
    # Of the diagonal: its derivatives by the coefficients, and by the logarithm of the variance.
    slopes = 2 * np.einsum("ij,kjl,li->ki", covariance, along[..., :p], covariance, optimize=True) / std**2
    scatter = np.sum(slopes * (known @ slopes), axis=0) + 2 / n * np.diag(covariance) ** 2
    return moves.T @ known @ moves, scatter


def _before(columns: np.ndarray, starts: np.ndarray, order: int) -> np.ndarray:
    """The columns 1 to `order` rows before each that has so many, shape (order, m, c)."""
    parts = [part for part in np.split(columns, starts[1:]) if part.shape[0] > order]
    return np.concatenate(
        [np.stack([part[order - k : part.shape[0] - k] for k in range(1, order + 1)]) for part in parts], axis=1
    )
