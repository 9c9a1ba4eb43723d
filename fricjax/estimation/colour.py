"""Noise models estimated from residuals, and whitening for generalised least squares.

Correlated noise makes neighbouring residuals similar, and standard errors that assume independence are then too
small. Here the noise is an autoregressive process (:mod:`.autoregression`) or the response of a linear system to
white noise (:mod:`.process`). The matching filter turns residuals and their derivatives into independent innovations.
Least squares of the filtered values are generalised least squares with the appropriate covariance. Drift, hum lines
and rounding errors are deterministic functions; their amplitudes are fitted together with the parameters.
"""

from typing import NamedTuple

import numpy as np

from .. import thresholds
from .autoregression import (
    ROUNDING,
    autoregression,
    excitation,
    gram,
    innovations,
    longest_memory,
    process_of,
    spread_of,
    start_of,
    without_level,
)
from .covariance import WEAKEST
from .hum import lines_of, waves_of
from .process import StateTransition, filtered

# Iterations between parameters and noise model until both converge to a hundredth of a standard error, and
# iterations of the restricted likelihood.
_ROUNDS, _RESTRICTED_ROUNDS = 4, 12


class Series(NamedTuple):
    """Residuals of one run in equidistant rows, relative to their noise.

    A row is the mean of consecutive samples.

    Attributes:
        t: times [s], shape (n,).
        residual: shape (n,).
        slopes: derivatives of the residuals with respect to the coordinates, shape (n, p).
        unit: effect of a unit displacement on each row, one over its relative noise, shape (n,).
        starts: index of each row that begins a segment, including the first row.
        rounding: functions that describe the rounding of the reading, shape (n, k); k is 0 for no rounding.
    """

    t: np.ndarray
    residual: np.ndarray
    slopes: np.ndarray
    unit: np.ndarray
    starts: np.ndarray
    rounding: np.ndarray


class Colour(NamedTuple):
    """Noise model of a series.

    Attributes:
        coefficients: coefficients of the autoregressive process, nearest lag first, shape (order,).
        std: standard deviation of an innovation, in units of the residuals.
        left: residuals after fitting the parameters and the deterministic functions, shape (n,).
        drift: True if the first deterministic function is a drift.
        lines: frequencies of the hum [Hz].
        sizes: coefficient of each deterministic function; adding size times function to the residuals removes it,
            shape (k,).
        excited: size of the process at its start relative to its stationary size.
        kicks: spectral density of the white acceleration that drives `transition`, in units of the variance of the
            independent noise.
        spread: log determinant of the covariance for innovations of unit variance: sum of the logarithms of the
            predicted variances of all rows.
        transition: state transition of the driven linear system; None if there is no such system.
        sides: pairs (kicks, std) with `kicks` one standard error weaker and stronger.
        shape: autoregressive coefficients of the remaining innovations of the moving rows, since floor motion is not
            white at all frequencies; empty if they are white.
        shape_std: standard deviation of the innovations of that process.
        last: number of rows to use from the start; later rows deviate too far for a linear system. None for all.
    """

    coefficients: np.ndarray
    std: float
    left: np.ndarray
    beside: np.ndarray  # Deterministic functions, shape (n, k): drift, lines of a hum, rounding.
    drift: bool
    lines: tuple[float, ...]
    sizes: np.ndarray
    excited: float = 1.0
    kicks: float = 0.0
    spread: float = 0.0
    transition: StateTransition | None = None
    sides: tuple[tuple[float, float], ...] = ()
    shape: np.ndarray = np.zeros(0)
    shape_std: float = 1.0
    last: int | None = None

    @property
    def waves(self) -> np.ndarray:
        """Cosine and sine amplitudes of each line, shape (lines, 2)."""
        first = int(self.drift)
        return self.sizes[first : first + 2 * len(self.lines)].reshape(-1, 2)

    def speed(self, t: np.ndarray) -> float:
        """Return the speed of the drift over the times of a series."""
        return float(self.sizes[0] / np.ptp(t)) if self.drift else 0.0

    def at(self, t: np.ndarray, series: np.ndarray) -> np.ndarray:
        """Evaluate drift and hum at times within the range of a series."""
        waves = np.zeros(t.size)
        for line, (cosine, sine) in zip(self.lines, self.waves, strict=True):
            waves += cosine * np.cos(2 * np.pi * line * t) + sine * np.sin(2 * np.pi * line * t)
        return self.speed(series) * (t - series.mean()) + waves

    @property
    def has_level(self) -> bool:
        """True if the noise has a mean level, unlike a random walk."""
        return abs(1 - float(self.coefficients.sum())) > ROUNDING

    @property
    def log_determinant(self) -> float:
        """Log determinant of the covariance of the rows, from the innovation variances."""
        return float(self.left.size * np.log(self.std**2)) + self.spread

    @property
    def n_parameters(self) -> int:
        """Number of parameters besides the variance; each line has three."""
        processes = self.coefficients.size + self.shape.size + (self.shape.size > 0)
        return processes + self.sizes.size + len(self.lines) + (self.transition is not None)


def colour_of(series: Series, level: float, drifts: bool, motion: float = 0.0) -> Colour | None:
    """Fit a noise model to the residuals; return None for white noise.

    Args:
        series: residuals of a fit and their derivatives.
        level: variance of its rows if their samples were independent.
        drifts: whether to allow a drift; False if the fit already includes one.
        motion: frequency of the motion [Hz]; a line near it indicates a model error, not hum.
    """
    n = series.t.size
    alone, criterion = _candidate(series, np.zeros((n, 0)), False, ())
    u = (series.t - series.t.mean()) / max(np.ptp(series.t), np.finfo(float).tiny)
    drift = (u * series.unit)[:, None]
    # Any model beyond a single autoregressive process requires very strong evidence.
    rivals = [(alone, criterion - thresholds.VERY_STRONG)]
    if drifts and (alone.coefficients.size or _shows(alone.left, series.slopes, drift[:, 0])):
        rivals.append(_candidate(series, drift, True, ()))
    for so_far, _ in tuple(rivals):
        lines = lines_of(series.t, series.unit, so_far.left, motion)
        for many in range(1, len(lines) + 1):
            waves = waves_of(series.t, series.unit, lines[:many])
            functions = np.column_stack([drift[:, : int(so_far.drift)], waves])
            rivals.append(_candidate(series, functions, so_far.drift, lines[:many]))
    best, _ = min(rivals, key=lambda rival: rival[1])
    if best.coefficients.size:
        return _restricted(series, best)
    as_white = abs(np.log(max(best.std, 1e-300) ** 2 / level)) < thresholds.SURE * np.sqrt(2 / n)
    return None if best is alone and as_white and not series.rounding.size else best


def process_of_noise(series: Series, level: float) -> Colour | None:
    """Fit a noise model that contains only an autoregressive process."""
    alone, _ = _candidate(series._replace(rounding=series.rounding[:, :0]), np.zeros((series.t.size, 0)), False, ())
    if alone.coefficients.size:
        return _restricted(series, alone)
    as_white = abs(np.log(max(alone.std, 1e-300) ** 2 / level)) < thresholds.SURE * np.sqrt(2 / series.t.size)
    return None if as_white else alone


def _restricted(series: Series, colour: Colour) -> Colour:
    """Refit the autoregressive process by restricted likelihood.

    The fitted functions absorb part of the correlated noise, mostly near the frequency of the motion, so the residuals
    contain too little of it. Each step adds the expected loss back to the lagged products: one standard error along
    each fitted function. This is expectation maximisation (Laird and Ware, Biometrics 38, 963, 1982).
    """
    columns = np.column_stack([series.slopes, colour.beside])
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), np.finfo(float).tiny)
    columns, coefficients, most = columns / scale, colour.coefficients, longest_memory(series.t.size, series.starts)
    left, std, sizes, excited = colour.left, colour.std, np.zeros(scale.size), 1.0
    for _ in range(_RESTRICTED_ROUNDS):
        excited = excitation(left, series.starts, coefficients, std)
        white = innovations(np.column_stack([series.residual, columns]), series.starts, coefficients, excited)
        sizes, standard = _least_squares(white)
        left, rest = series.residual + columns @ sizes, white[:, 0] + white[:, 1:] @ sizes
        std = float(np.sqrt(rest @ rest / max(rest.size - standard.shape[1] - coefficients.size, 1)))
        parts = [left, *(std * (columns @ standard)).T]
        grams, counts = zip(*(gram(part, series.starts, most) for part in parts), strict=True)
        sums, before = np.sum(grams, axis=0), coefficients
        coefficients = without_level(process_of(sums, counts[0])[0], sums, counts[0])
        if before.shape == coefficients.shape and np.allclose(before, coefficients, rtol=0, atol=1e-4):
            break
    return colour._replace(
        coefficients=coefficients,
        std=std,
        left=left,
        sizes=(sizes / scale)[series.slopes.shape[1] :],
        spread=spread_of(coefficients, series.starts, left.size, excited),
        excited=excited,
    )


def _least_squares(white: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Regress the first column on the others; return coefficients and orthonormal combinations.

    Before filtering the columns had unit mean square. A column that the filter reduces to rounding error is dropped,
    for example a constant under the filter of a random walk.
    """
    columns = white[:, 1:]
    standard = _orthonormal(columns.T @ columns, ROUNDING**2 * columns.shape[0])
    return -standard @ (standard.T @ (columns.T @ white[:, 0])), standard


def _orthonormal(products: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Return the orthonormal combinations of columns, shape (columns, rank).

    The normal products suffice; decomposing long columns takes ten times as long. Columns with a square of at most
    `least` are ignored.
    """
    squares = np.diag(products)
    unit = np.sqrt(np.divide(1.0, squares, out=np.zeros(squares.size), where=squares > least))
    eigenvalues, vectors = np.linalg.eigh(unit[:, None] * products * unit)
    kept = eigenvalues > WEAKEST * max(eigenvalues[-1:], default=0.0)
    return unit[:, None] * vectors[:, kept] / np.sqrt(eigenvalues[kept])


def _shows(left: np.ndarray, slopes: np.ndarray, function: np.ndarray) -> bool:
    """Return True if a function may explain more than the derivatives do.

    The residuals `left` are white.
    """
    along = _orthonormal(slopes.T @ slopes).T @ (slopes.T @ function)
    apart = function @ function - along @ along
    explained = (function @ left) ** 2 / max(apart, 1e-9 * (function @ function), np.finfo(float).tiny)
    share = min(explained / max(left @ left, np.finfo(float).tiny), 0.999)
    # Half the evidence required later.
    return bool(-left.size * np.log1p(-share) > thresholds.VERY_STRONG / 2)


def _candidate(series: Series, functions: np.ndarray, drift: bool, lines: tuple[float, ...]) -> tuple[Colour, float]:
    """Fit a process with deterministic functions; return the model and Schwarz's criterion.

    The functions are those given and the rounding of the series.
    """
    beside = np.column_stack([functions, series.rounding])
    columns = np.column_stack([series.slopes, beside])
    columns = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), np.finfo(float).tiny)
    coefficients, criterion, sizes = np.zeros(0), np.inf, np.zeros(columns.shape[1])
    left, variance = series.residual, 1.0
    for _ in range(_ROUNDS):
        white = innovations(np.column_stack([series.residual, columns]), series.starts, coefficients)
        sizes, standard = _least_squares(white)
        left = series.residual + columns @ sizes
        dof = max(white.shape[0] - standard.shape[1] - coefficients.size, 1)
        variance = float(np.sum((white[:, 0] + white[:, 1:] @ sizes) ** 2)) / dof
        before, (coefficients, criterion) = coefficients, autoregression(left, series.starts)
        if before.shape == coefficients.shape and np.allclose(before, coefficients, rtol=0, atol=1e-3):
            break
    criterion += (beside.shape[1] + len(lines)) * np.log(series.t.size)
    unit = np.sqrt(np.mean(beside**2, axis=0))
    sizes = sizes[series.slopes.shape[1] :] / np.where(unit > 0, unit, 1.0)
    colour = Colour(coefficients, float(np.sqrt(variance)), left, beside, drift, lines, sizes)
    return colour, float(criterion)


def white(series: Series, level: float) -> Colour:
    """Return the noise model of white noise with row variance `level`."""
    nothing = np.zeros(0)
    return Colour(nothing, float(np.sqrt(level)), series.residual, np.zeros((series.t.size, 0)), False, (), nothing)


def whitened(series: Series, colour: Colour) -> tuple[np.ndarray, np.ndarray]:
    """Return innovations of unit variance and their derivatives.

    The deterministic functions are projected out of both.
    """
    columns = whitened_columns(np.column_stack([series.residual, series.slopes, colour.beside]), series, colour)
    p = series.slopes.shape[1] + 1
    white = columns[:, :p]
    if colour.beside.size:
        basis = np.linalg.qr(columns[:, p:] / np.maximum(np.linalg.norm(columns[:, p:], axis=0), 1e-300))[0]
        white = white - basis @ (basis.T @ white)
    return white[:, 0], white[:, 1:]


def whitened_columns(columns: np.ndarray, series: Series, colour: Colour) -> np.ndarray:
    """Whiten columns with the rows of a series to unit innovation variance."""
    if colour.transition is None:
        return innovations(columns, series.starts, colour.coefficients, colour.excited) / colour.std
    white = filtered(columns, series.unit, colour.transition, np.array([colour.kicks]))[0][0] / colour.std
    moving = colour.transition.moving
    shaped = innovations(white[:moving], np.zeros(1, int), colour.shape) / colour.shape_std
    return np.concatenate([shaped, white[moving:]])[: colour.last]


def instants(series: Series, colour: Colour) -> np.ndarray:
    """Return the times of the rows that remain after whitening."""
    order = colour.coefficients.size
    if colour.transition is not None:
        return series.t[: colour.last]
    if start_of(colour.coefficients).shape[0] == order:
        return series.t
    return np.concatenate([part[order:] for part in np.split(series.t, series.starts[1:])])


def autoregressive(series: Series) -> Colour:
    """Fit an autoregressive process to the residuals without any deterministic function."""
    coefficients, _ = autoregression(series.residual, series.starts)
    level = float(np.var(innovations(series.residual[:, None], series.starts, coefficients)))
    spread = spread_of(coefficients, series.starts, series.t.size)
    return white(series, level)._replace(coefficients=coefficients, spread=spread)
