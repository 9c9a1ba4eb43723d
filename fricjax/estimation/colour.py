"""The colour of noise, estimated from the residuals of a fit, and least squares that weight residuals by it.

Noise that remembers makes neighbouring residuals repeat each other, and standard errors that take them for
independent are too small. Here the noise is a process (:mod:`.autoregression`), or kicks of a
linear system (:mod:`.process`): residuals and their derivatives go through the filter that makes innovations
of it before they are squared, and the least squares of what comes out are the generalised ones, with the covariance
that belongs to them. A drift and the lines of a hum are no process but a function of time, and rounding is one of the
reading: their size is fitted beside the parameters.
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

# Rounds in which the parameters and the colour of what they leave converge to a hundredth of a standard error, and in
# which the restricted likelihood of the colour does.
_ROUNDS, _RESTRICTED_ROUNDS = 4, 12


class Series(NamedTuple):
    """Residuals of one run in rows that follow each other at one interval of time, in units of their relative noise.

    Attributes:
        t: times [s], shape (n,).
        residual: shape (n,); `slopes`: their derivatives by the coordinates, shape (n, p).
        unit: what a displacement that all rows share is in each of them, one over the relative noise, shape (n,).
        starts: number of each row that does not follow on the one before it, the first one included.
        rounding: functions of the reading that its rounding leaves in the residuals, shape (n, k); k is 0 for none.
    """

    t: np.ndarray
    residual: np.ndarray
    slopes: np.ndarray
    unit: np.ndarray
    starts: np.ndarray
    rounding: np.ndarray


class Colour(NamedTuple):
    """What the noise of a series is.

    Attributes:
        coefficients: of the process, the nearest first, shape (order,).
        std: standard deviation of an innovation, in units of the residuals.
        left: the residuals with the parameters and the functions beside the noise fitted anew, shape (n,).
        beside: functions that are in the residuals beside the noise, shape (n, k): drift, lines of a hum, rounding.
        drift: whether a drift is among them, the first; `lines`: frequencies of the hum [Hz].
        sizes: amplitude of each that is to be added to the residuals to remove it from them, shape (k,).
        excited: size of the process at its start, where the release may excite it, over its stationary one.
        kicks: spectral density of kicks that make the noise beside an independent part, in squared units of the latter.
        spread: sum of the logarithms of the variances of all rows, those before known, over that of an innovation.
        transition: of the linear system that they kick; None where there are none.
        sides: kicks that are one standard error weaker or stronger, and the standard deviations beside them.
        shape: coefficients of the process that the innovations of moving rows still are, for a floor does not shake
            alike at all frequencies; none where they are white. `shape_std`: deviation of its innovations.
        last: number of rows that count, from the first on, for behind them kicks have led too far from the motion for
            a linear system; None for all.
    """

    coefficients: np.ndarray
    std: float
    left: np.ndarray
    beside: np.ndarray
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
        """Amplitudes of the cosine and the sine of each line, shape (lines, 2)."""
        first = int(self.drift)
        return self.sizes[first : first + 2 * len(self.lines)].reshape(-1, 2)

    def speed(self, t: np.ndarray) -> float:
        """Speed of the drift over the times of a series."""
        return float(self.sizes[0] / np.ptp(t)) if self.drift else 0.0

    def at(self, t: np.ndarray, series: np.ndarray) -> np.ndarray:
        """Drift and hum at times, which are those of a series or between them."""
        waves = np.zeros(t.size)
        for line, (cosine, sine) in zip(self.lines, self.waves, strict=True):
            waves += cosine * np.cos(2 * np.pi * line * t) + sine * np.sin(2 * np.pi * line * t)
        return self.speed(series) * (t - series.mean()) + waves

    @property
    def has_level(self) -> bool:
        """Whether the noise has a level about which it wanders, unlike a random walk."""
        return abs(1 - float(self.coefficients.sum())) > ROUNDING

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the covariance of the rows, by the variances of their innovations."""
        return float(self.left.size * np.log(self.std**2)) + self.spread

    @property
    def n_parameters(self) -> int:
        """How many numbers it has beside the variance; a line has a frequency besides its two sizes."""
        processes = self.coefficients.size + self.shape.size + (self.shape.size > 0)
        return processes + self.sizes.size + len(self.lines) + (self.transition is not None)


def colour_of(series: Series, level: float, drifts: bool, motion: float = 0.0) -> Colour | None:
    """The colour of what a fit leaves, None for white noise.

    Args:
        series: residuals of a fit and their derivatives.
        level: variance of its rows if their samples were independent.
        drifts: whether a drift may be in the residuals, which is not where the fit has one of its own.
        motion: frequency of the motion itself [Hz]; a line near it is no hum but what the model lacks.
    """
    n = series.t.size
    alone, criterion = _candidate(series, np.zeros((n, 0)), False, ())
    u = (series.t - series.t.mean()) / max(np.ptp(series.t), np.finfo(float).tiny)
    drift = (u * series.unit)[:, None]
    # Whatever is more than a process alone has to show by very strong evidence.
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
    """The same where nothing but a process may be in the residuals."""
    alone, _ = _candidate(series._replace(rounding=series.rounding[:, :0]), np.zeros((series.t.size, 0)), False, ())
    if alone.coefficients.size:
        return _restricted(series, alone)
    as_white = abs(np.log(max(alone.std, 1e-300) ** 2 / level)) < thresholds.SURE * np.sqrt(2 / series.t.size)
    return None if as_white else alone


def _restricted(series: Series, colour: Colour) -> Colour:
    """The same process by its restricted likelihood.

    What functions were fitted to noise that remembers took of it is missing in the residuals, and most of it where the
    motion itself has its power. Products of the noise are expected to be those of the residuals and of what the
    functions took in the mean, one standard error each: a step of expectation and maximisation (Laird and Ware,
    Biometrics 38, 963, 1982), with which the coefficients converge.
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
    """Sizes of columns behind the first that make it the least, and the combinations of them that are orthonormal.

    The columns had a mean square of one before they went through a filter; what this leaves of one but for rounding, as
    of a constant through that of a random walk, counts.
    """
    columns = white[:, 1:]
    standard = _orthonormal(columns.T @ columns, ROUNDING**2 * columns.shape[0])
    return -standard @ (standard.T @ (columns.T @ white[:, 0])), standard


def _orthonormal(products: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Combinations of columns, as many as these determine, that are orthonormal, shape (columns, rank).

    By their products: of long columns a decomposition takes ten times as long, and on busy cores a hundred. A column
    whose square is not above `least` is none.
    """
    squares = np.diag(products)
    unit = np.sqrt(np.divide(1.0, squares, out=np.zeros(squares.size), where=squares > least))
    eigenvalues, vectors = np.linalg.eigh(unit[:, None] * products * unit)
    kept = eigenvalues > WEAKEST * max(eigenvalues[-1:], default=0.0)
    return unit[:, None] * vectors[:, kept] / np.sqrt(eigenvalues[kept])


def _shows(left: np.ndarray, slopes: np.ndarray, function: np.ndarray) -> bool:
    """Whether a function of time may explain some of white residuals, which the derivatives do not."""
    along = _orthonormal(slopes.T @ slopes).T @ (slopes.T @ function)
    apart = function @ function - along @ along
    explained = (function @ left) ** 2 / max(apart, 1e-9 * (function @ function), np.finfo(float).tiny)
    share = min(explained / max(left @ left, np.finfo(float).tiny), 0.999)
    # Half the evidence that will be asked for.
    return bool(-left.size * np.log1p(-share) > thresholds.VERY_STRONG / 2)


def _candidate(series: Series, functions: np.ndarray, drift: bool, lines: tuple[float, ...]) -> tuple[Colour, float]:
    """The colour of a process beside functions of time and the rounding, and Schwarz's criterion."""
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
    """The colour of white noise with this variance of a row."""
    nothing = np.zeros(0)
    return Colour(nothing, float(np.sqrt(level)), series.residual, np.zeros((series.t.size, 0)), False, (), nothing)


def whitened(series: Series, colour: Colour) -> tuple[np.ndarray, np.ndarray]:
    """Innovations of unit variance, and their derivatives by the coordinates, without what other functions explain."""
    columns = whitened_columns(np.column_stack([series.residual, series.slopes, colour.beside]), series, colour)
    p = series.slopes.shape[1] + 1
    white = columns[:, :p]
    if colour.beside.size:
        basis = np.linalg.qr(columns[:, p:] / np.maximum(np.linalg.norm(columns[:, p:], axis=0), 1e-300))[0]
        white = white - basis @ (basis.T @ white)
    return white[:, 0], white[:, 1:]


def whitened_columns(columns: np.ndarray, series: Series, colour: Colour) -> np.ndarray:
    """Columns in the rows of a series, through the filter that makes innovations of unit variance of its noise."""
    if colour.transition is None:
        return innovations(columns, series.starts, colour.coefficients, colour.excited) / colour.std
    white = filtered(columns, series.unit, colour.transition, np.array([colour.kicks]))[0][0] / colour.std
    moving = colour.transition.moving
    shaped = innovations(white[:moving], np.zeros(1, int), colour.shape) / colour.shape_std
    return np.concatenate([shaped, white[moving:]])[: colour.last]


def instants(series: Series, colour: Colour) -> np.ndarray:
    """Times of the rows that are left of a series once it is whitened."""
    order = colour.coefficients.size
    if colour.transition is not None:
        return series.t[: colour.last]
    if start_of(colour.coefficients).shape[0] == order:
        return series.t
    return np.concatenate([part[order:] for part in np.split(series.t, series.starts[1:])])


def autoregressive(series: Series) -> Colour:
    """The colour of an autoregression of the residuals as they are, without functions beside it."""
    coefficients, _ = autoregression(series.residual, series.starts)
    level = float(np.var(innovations(series.residual[:, None], series.starts, coefficients)))
    spread = spread_of(coefficients, series.starts, series.t.size)
    return white(series, level)._replace(coefficients=coefficients, spread=spread)
