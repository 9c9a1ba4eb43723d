"""Autoregressive noise: estimate the process and whiten residuals with it.

Each value is a linear combination of the previous values plus an independent innovation u,

    n_i = a_1 n_(i-1) + ... + a_p n_(i-p) + u_i.

Least squares estimates the coefficients. Unlike the Yule-Walker equations it stays accurate near a unit root.
Schwarz's criterion selects the order (Brockwell and Davis, Time Series, 1991, 8.7 and 9.3). The data consist of
uninterrupted segments; `starts` holds the index of the first value of each segment, including the first segment.
"""

import numpy as np

from .. import thresholds

# Highest order. Broad hum, or a resonance under white noise, takes about ten.
_MOST = 24
# Rows required for each coefficient or nuisance parameter.
_ROWS = 8
# Standard errors by which a process must differ from a random walk to be considered stationary. A true random walk
# reaches up to 4.4, and more if other functions are fitted with it (Fuller, Introduction to Statistical Time Series,
# 1996, table 10.A.2).
_LEVELLED = 5.0
# Rounding tolerance for a sum of coefficients equal to one, and for a filter output equal to zero.
ROUNDING = 1e-9


def autoregression(left: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, float]:
    """Fit coefficients and order by Schwarz's criterion; return the criterion too.

    White noise is rejected only on very strong evidence.
    """
    return process_of(*gram(left, starts, longest_memory(left.size, starts)))


def longest_memory(rows: int, starts: np.ndarray) -> int:
    """Return the highest order that the longest segment can determine."""
    return min(_MOST, int(np.max(np.diff(np.append(starts, rows)), initial=0)) // _ROWS)


def process_of(sums: np.ndarray, n: int) -> tuple[np.ndarray, float]:
    """Fit coefficients from lagged products of `n` values; return Schwarz's criterion too.

    `sums` has shape (most + 1,) * 2.
    """
    most = sums.shape[0] - 1
    if n == 0 or not sums[0, 0] > 0:
        return np.zeros(0), np.inf
    # If the values follow a smooth curve, the lags are collinear to within rounding.
    lags = sums[1:, 1:] + 1e-13 * sums[0, 0] * np.eye(most)
    lower = np.linalg.cholesky(lags) if most else lags
    # Reduction of the sum of squares by each further order; one factorisation serves all orders.
    along = np.linalg.solve(lower, sums[1:, 0])
    squares = sums[0, 0] - np.concatenate([[0.0], np.cumsum(along**2)])
    criteria = n * np.log(np.maximum(squares, 1e-30 * sums[0, 0]) / n) + np.log(n) * np.arange(most + 1)
    criteria[0] -= thresholds.VERY_STRONG
    order = int(np.argmin(criteria))
    return np.linalg.solve(lower[:order, :order].T, along[:order]), float(criteria[order])


def without_level(coefficients: np.ndarray, sums: np.ndarray, n: int) -> np.ndarray:
    """Return coefficients constrained to sum to one, unless they clearly do not.

    If they sum to one, the process is a random walk and has no mean level.
    """
    order = coefficients.size
    if not order:
        return coefficients
    inverse = np.linalg.pinv(sums[1 : order + 1, 1 : order + 1], rcond=1e-13, hermitian=True)
    square = sums[0, 0] - coefficients @ sums[1 : order + 1, 0]
    toward, missing = inverse.sum(axis=0), 1 - coefficients.sum()
    clearly = missing**2 >= _LEVELLED**2 * toward.sum() * square / n
    return coefficients if clearly else coefficients + toward * missing / toward.sum()


def gram(left: np.ndarray, starts: np.ndarray, most: int) -> tuple[np.ndarray, int]:
    """Sum lagged products up to lag `most`; also return the term count."""
    sums, n = np.zeros((most + 1, most + 1)), 0
    for part in np.split(left, starts[1:]):
        if part.size > most:
            sums, n = sums + _products(part, most), n + part.size - most
    return sums, n


def _products(part: np.ndarray, most: int) -> np.ndarray:
    """Sum lagged products of one segment, shape (most + 1,) * 2.

    Entry (i, j) sums the products of the values i and j places before each value that has `most` predecessors. Entries
    (i + 1, j + 1) and (i, j) differ only by one product at each end.
    """
    n, sums = part.size, np.zeros((most + 1, most + 1))
    sums[0] = [part[most:] @ part[most - lag : n - lag] for lag in range(most + 1)]
    begin, end = part[most - 1 :: -1][:most], part[::-1][:most]
    for i in range(most):
        sums[i + 1, 0] = sums[0, i + 1]
        sums[i + 1, 1:] = sums[i, :-1] + begin[i] * begin - end[i] * end
    return sums


def innovations(columns: np.ndarray, starts: np.ndarray, coefficients: np.ndarray, excited: float = 1.0) -> np.ndarray:
    """Apply the whitening filter of the noise to the columns.

    The first rows of a segment have too few predecessors for the filter. They get the weights of a stationary process
    that starts `excited` times larger. For a non-stationary process they are omitted, since they carry no information
    about its level.
    """
    order = coefficients.size
    if not order:
        return columns
    newest_first, start = np.concatenate([[1.0], -coefficients]), start_of(coefficients) / excited
    white = [columns[:0]]
    for part in np.split(columns, starts[1:]):
        white.append(start[: part.shape[0], : part.shape[0]] @ part[:order])
        if part.shape[0] > order:
            windows = np.lib.stride_tricks.sliding_window_view(part, order + 1, axis=0)[..., ::-1]
            white.append(windows @ newest_first)
    return np.concatenate(white)


def start_of(coefficients: np.ndarray) -> np.ndarray:
    """Return the matrix that whitens the first values of a stationary process.

    Each value is predicted from those before it by the process of one order less (backward Durbin-Levinson recursion;
    Brockwell and Davis, 5.2). The shape is (order, order), or (0, order) for a process that is not stationary.
    """
    order, a, variance = coefficients.size, coefficients, 1.0
    whitener = np.zeros((order, order))
    for j in range(order - 1, -1, -1):
        last = float(a[j])
        if abs(last) > 1 - ROUNDING:
            return np.zeros((0, order))
        a, variance = (a[:j] + last * a[:j][::-1]) / (1 - last**2), variance / (1 - last**2)
        whitener[j, : j + 1] = np.concatenate([-a[::-1], [1.0]]) / np.sqrt(variance)
    return whitener


def excitation(left: np.ndarray, starts: np.ndarray, coefficients: np.ndarray, std: float) -> float:
    """Return the initial size of a process over its stationary size.

    At least one; releasing the oscillator may excite a mode and make the start larger.
    """
    start, order = start_of(coefficients), coefficients.size
    parts = [part[:order] for part in np.split(left, starts[1:])]
    first = np.concatenate([start[: part.size, : part.size] @ part for part in parts])
    return max(float(np.sqrt(np.mean(first**2))) / std, 1.0) if first.size else 1.0


def spread_of(coefficients: np.ndarray, starts: np.ndarray, rows: int, excited: float = 1.0) -> float:
    """Return the log determinant of the first values' covariance, over all segments.

    The covariance is that for innovations of unit variance.
    """
    each = -2 * np.log(np.diag(start_of(coefficients)) / excited)
    return float(sum(each[:length].sum() for length in np.diff(np.append(starts, rows))))
