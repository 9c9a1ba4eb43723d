"""Noise that remembers: its process estimated from its values, and the filter that makes innovations of it.

A value follows from the last few and a fresh innovation,

    n_i = a_1 n_(i-1) + ... + a_p n_(i-p) + u_i.

Coefficients come from least squares, which unlike those of Yule and Walker stay right for a process that hardly
forgets; the order from Schwarz's criterion (Brockwell and Davis, Time Series, 1991, 8.7 and 9.3). Values come in
stretches, of which `starts` gives the number of the first value, that of the first stretch included.
"""

import numpy as np

from .. import thresholds

# Longest memory in rows. A hum that is no line, and a resonance under white noise, take some ten.
_MOST = 24
# Rows that an order or a nuisance must have for each of its numbers.
_ROWS = 8
# Standard errors by which a process must differ from one that walks at random to be taken for one with a level. A walk
# itself seems to by up to 4.4, the more so the more is fitted beside it (Fuller, Introduction to Statistical Time
# Series, 1996, table 10.A.2).
_LEVELLED = 5.0
# By how much a sum of coefficients that is one may differ from it, and what a filter may leave of nothing.
ROUNDING = 1e-9


def autoregression(left: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients of the process of the order that Schwarz's criterion chooses, and the criterion.

    White noise is given up for another only where the evidence is very strong.
    """
    return process_of(*gram(left, starts, longest_memory(left.size, starts)))


def longest_memory(rows: int, starts: np.ndarray) -> int:
    """The highest order that the longest stretch of rows can determine."""
    return min(_MOST, int(np.max(np.diff(np.append(starts, rows)), initial=0)) // _ROWS)


def process_of(sums: np.ndarray, n: int) -> tuple[np.ndarray, float]:
    """The same from sums of products of `n` values with those before them, shape (most + 1,) * 2."""
    most = sums.shape[0] - 1
    if n == 0 or not sums[0, 0] > 0:
        return np.zeros(0), np.inf
    # Values that follow a line or a smooth curve make the lags depend on each other to within rounding.
    lags = sums[1:, 1:] + 1e-13 * sums[0, 0] * np.eye(most)
    lower = np.linalg.cholesky(lags) if most else lags
    # What each further order takes from the sum of squares: one factor serves all orders.
    along = np.linalg.solve(lower, sums[1:, 0])
    squares = sums[0, 0] - np.concatenate([[0.0], np.cumsum(along**2)])
    criteria = n * np.log(np.maximum(squares, 1e-30 * sums[0, 0]) / n) + np.log(n) * np.arange(most + 1)
    criteria[0] -= thresholds.VERY_STRONG
    order = int(np.argmin(criteria))
    return np.linalg.solve(lower[:order, :order].T, along[:order]), float(criteria[order])


def without_level(coefficients: np.ndarray, sums: np.ndarray, n: int) -> np.ndarray:
    """Coefficients that sum up to one, in which the noise has no level, where theirs is not clearly another."""
    order = coefficients.size
    if not order:
        return coefficients
    inverse = np.linalg.pinv(sums[1 : order + 1, 1 : order + 1], rcond=1e-13, hermitian=True)
    square = sums[0, 0] - coefficients @ sums[1 : order + 1, 0]
    toward, missing = inverse.sum(axis=0), 1 - coefficients.sum()
    clearly = missing**2 >= _LEVELLED**2 * toward.sum() * square / n
    return coefficients if clearly else coefficients + toward * missing / toward.sum()


def gram(left: np.ndarray, starts: np.ndarray, most: int) -> tuple[np.ndarray, int]:
    """Sums of products of values up to so many places apart, and how many of each."""
    sums, n = np.zeros((most + 1, most + 1)), 0
    for part in np.split(left, starts[1:]):
        if part.size > most:
            sums, n = sums + _products(part, most), n + part.size - most
    return sums, n


def _products(part: np.ndarray, most: int) -> np.ndarray:
    """Sums of products of the values `i` and `j` places before each that has `most` before it, shape (most + 1,) * 2.

    Those one place further back are the same sums but for a product at either end.
    """
    n, sums = part.size, np.zeros((most + 1, most + 1))
    sums[0] = [part[most:] @ part[most - lag : n - lag] for lag in range(most + 1)]
    begin, end = part[most - 1 :: -1][:most], part[::-1][:most]
    for i in range(most):
        sums[i + 1, 0] = sums[0, i + 1]
        sums[i + 1, 1:] = sums[i, :-1] + begin[i] * begin - end[i] * end
    return sums


def innovations(columns: np.ndarray, starts: np.ndarray, coefficients: np.ndarray, excited: float = 1.0) -> np.ndarray:
    """The columns through the filter that whitens the noise.

    The first rows of a stretch, which have too few before them, are weighted by what a stationary process makes of
    them, `excited` times as large; one that is not stationary says nothing of its level, and they are left out.
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
    """What makes the first values of a stationary process as many innovations, shape (order, order).

    Each is predicted by those before it: by the process of so many coefficients, which follows from that of one more
    (Durbin's and Levinson's recursion backwards; Brockwell and Davis, 5.2). Where there is no such process: (0, order).
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
    """Size of a process at its start over its stationary one, as of a mode that the release excites; at least one."""
    start, order = start_of(coefficients), coefficients.size
    parts = [part[:order] for part in np.split(left, starts[1:])]
    first = np.concatenate([start[: part.size, : part.size] @ part for part in parts])
    return max(float(np.sqrt(np.mean(first**2))) / std, 1.0) if first.size else 1.0


def spread_of(coefficients: np.ndarray, starts: np.ndarray, rows: int, excited: float = 1.0) -> float:
    """Sum of the logarithms of the variances of the first values of all stretches over that of the innovations."""
    each = -2 * np.log(np.diag(start_of(coefficients)) / excited)
    return float(sum(each[:length].sum() for length in np.diff(np.append(starts, rows))))
