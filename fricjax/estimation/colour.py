"""The colour of noise, told from what a fit has left, and least squares that count residuals by it.

Noise that remembers makes residuals in a row tell the same again and again, and standard errors that take them for
independent are too small by as many times. Here the noise is a process whose value follows from the last few and a
fresh innovation,

    n_i = a_1 n_(i-1) + ... + a_p n_(i-p) + u_i,

so that ``n_i - a_1 n_(i-1) - ...`` is white: residuals and their derivatives go through that filter before they are
squared, and the least squares of what comes out are the generalised ones, with the covariance that belongs to them.
Coefficients come from least squares, which unlike those of Yule and Walker stay right for a process that hardly
forgets; the order from Schwarz's criterion (Brockwell and Davis, Time Series, 1991, 8.7 and 9.3). A drift and the lines
of a hum are no process but a function of time, and rounding is one of the reading: their size is fitted beside the
parameters.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .process import Passage, filtered, kicks_of
from .quadratic import RANK_TOLERANCE

# Longest memory in rows. A hum that is no line, and a resonance under white noise, take some ten.
_MOST = 24
# Rows that an order or a nuisance must have for each of its numbers.
_ROWS = 8
# Twice the logarithm of the odds from which evidence is called very strong (Kass and Raftery, J. Am. Stat. Assoc. 90,
# 773, 1995): white noise is called coloured in one of some hundred records.
_STRONG = 10.0
# Rounds in which the parameters and the colour of what they leave settle to a hundredth of a standard error, and in
# which the restricted likelihood of the colour does.
_ROUNDS, _SETTLING = 4, 12
# Standard errors by which a process must differ from one that walks at random to be taken for one with a level. A walk
# itself seems to by up to 4.4, the more so the more is fitted beside it (Fuller, Introduction to Statistical Time
# Series, 1996, table 10.A.2).
_LEVELLED = 5.0
# By how much a sum of coefficients that is one may differ from it, and what a filter may leave of nothing.
_ROUNDING = 1e-9
# Standard deviations by which the variance of rows and of samples may differ in white noise.
_LEVEL = 4.0
# Power of a line over that of its neighbours, how many of them, how far it reaches itself, and how many lines.
_LINE, _NEAR, _WIDE, _LINES = 30.0, 24, 3, 3
# Steps of Gauss and Newton to the frequency of a line, which begin within a tenth of the resolution.
_TUNINGS = 3


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
        left: of the residuals, the parameters and what is beside them fitted anew, shape (n,).
        beside: functions that are in the residuals besides, shape (n, k): a drift, the lines of a hum, the rounding.
        drift: whether a drift is among them, the first; `lines`: frequencies of the hum [Hz].
        excited: how many times larger than it is kept up the process starts.
        sizes: what of each is to be added to the residuals to make up for them, shape (k,).
        kicks: spectral density of kicks that make the noise beside an independent part, in squared units of the latter.
        spread: sum of the logarithms of the variances of all rows, given those before, over that of an innovation.
        passage: how a linear system carries them on; None where there are none.
        sides: kicks that are one standard error weaker or stronger, and the standard deviations beside them.
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
    passage: Passage | None = None
    sides: tuple[tuple[float, float], ...] = ()

    @property
    def waves(self) -> np.ndarray:
        """Sizes of the cosine and the sine of each line, shape (lines, 2)."""
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
    def levelled(self) -> bool:
        """Whether it has a level about which it wanders."""
        return abs(1 - float(self.coefficients.sum())) > _ROUNDING

    @property
    def size(self) -> float:
        """Sum of the logarithms of the variances of the innovations."""
        return float(self.left.size * np.log(self.std**2)) + self.spread

    @property
    def numbers(self) -> int:
        """How many numbers it has beside the variance; a line has a frequency besides its two sizes."""
        return self.coefficients.size + self.sizes.size + len(self.lines) + (self.passage is not None)


def colour_of(series: Series, level: float, drifts: bool, motion: float = 0.0) -> Colour | None:
    """The colour of what a fit leaves, None for white noise.

    Args:
        series: residuals of a fit and their derivatives.
        level: variance of its rows if their samples were independent.
        drifts: whether a drift may be in the residuals, which is not where the fit has one of its own.
        motion: frequency of the motion itself [Hz]; a line near it is no hum but what the model lacks.
    """
    n = series.t.size
    alone = _Candidate.of(series, np.zeros((n, 0)), False, ())
    u = (series.t - series.t.mean()) / max(np.ptp(series.t), np.finfo(float).tiny)
    drift = (u * series.unit)[:, None]
    found = [alone]
    if drifts and (alone.colour.coefficients.size or _shows(alone.colour.left, series.slopes, drift[:, 0])):
        found.append(_Candidate.of(series, drift, True, ()))
    for so_far in tuple(found):
        drifting, lines = so_far.colour.drift, _lines(series, so_far, motion)
        for many in range(1, len(lines) + 1):
            functions = np.column_stack([drift[:, : int(drifting)], _waves(series, lines[:many])])
            found.append(_Candidate.of(series, functions, drifting, lines[:many]))
    best = min(found, key=lambda candidate: candidate.criterion + (0.0 if candidate is alone else _STRONG))
    if best.colour.coefficients.size:
        return _restricted(series, best.colour)
    as_white = abs(np.log(max(best.colour.std, 1e-300) ** 2 / level)) < _LEVEL * np.sqrt(2 / n)
    return None if best is alone and as_white and not series.rounding.size else best.colour


def _restricted(series: Series, colour: Colour) -> Colour:
    """The same process by its restricted likelihood.

    What functions were fitted to noise that remembers took of it is missing in the residuals, and most of it where the
    motion itself has its power. Products of the noise are expected to be those of the residuals and of what the
    functions took in the mean, one standard error each: a step of expectation and maximisation (Laird and Ware,
    Biometrics 38, 963, 1982), with which the coefficients settle.
    """
    columns = np.column_stack([series.slopes, colour.beside])
    scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), np.finfo(float).tiny)
    columns, coefficients, most = columns / scale, colour.coefficients, _most(series.t.size, series.starts)
    left, std, sizes, excited = colour.left, colour.std, np.zeros(scale.size), 1.0
    for _ in range(_SETTLING):
        excited = _excited(left, series.starts, coefficients, std)
        white = innovations(np.column_stack([series.residual, columns]), series.starts, coefficients, excited)
        standard = _orthonormal(white[:, 1:])
        sizes = -standard @ (standard.T @ (white[:, 1:].T @ white[:, 0]))
        left, rest = series.residual + columns @ sizes, white[:, 0] + white[:, 1:] @ sizes
        std = float(np.sqrt(rest @ rest / max(rest.size - standard.shape[1] - coefficients.size, 1)))
        parts = [left, *(std * (columns @ standard)).T]
        grams, counts = zip(*(gram(part, series.starts, most) for part in parts), strict=True)
        sums, before = np.sum(grams, axis=0), coefficients
        coefficients = _without_level(_process(sums, counts[0])[0], sums, counts[0])
        if before.shape == coefficients.shape and np.allclose(before, coefficients, rtol=0, atol=1e-4):
            break
    return colour._replace(
        coefficients=coefficients,
        std=std,
        left=left,
        sizes=(sizes / scale)[series.slopes.shape[1] :],
        spread=_spread(coefficients, series.starts, left.size, excited),
        excited=excited,
    )


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    """Combinations of columns, as many as these determine, that are orthonormal, shape (columns, rank).

    The columns had a mean square of one before they went through a filter; what this leaves of one but for rounding, as
    of a constant through that of a random walk, counts. By products: of long columns a decomposition takes ten times as
    long, and on busy cores a hundred.
    """
    products = columns.T @ columns
    size = np.sqrt(np.diag(products))
    unit = np.divide(1.0, size, out=np.zeros(size.size), where=size > _ROUNDING * np.sqrt(columns.shape[0]))
    eigenvalues, vectors = np.linalg.eigh(unit[:, None] * products * unit)
    told = eigenvalues > RANK_TOLERANCE * max(eigenvalues[-1:], default=0.0)
    return unit[:, None] * vectors[:, told] / np.sqrt(eigenvalues[told])


def _shows(left: np.ndarray, slopes: np.ndarray, function: np.ndarray) -> bool:
    """Whether a function of time may explain some of white residuals, which the derivatives do not."""
    products = slopes.T @ slopes
    unit = 1 / np.sqrt(np.maximum(np.diag(products), np.finfo(float).tiny))
    along = unit * (slopes.T @ function)
    inverse = np.linalg.pinv(unit[:, None] * products * unit, rcond=1e-12, hermitian=True)
    apart = function @ function - along @ inverse @ along
    explained = (function @ left) ** 2 / max(apart, 1e-9 * (function @ function), np.finfo(float).tiny)
    # Half the evidence that will be asked for.
    return bool(-left.size * np.log1p(-min(explained / max(left @ left, np.finfo(float).tiny), 0.999)) > _STRONG / 2)


class _Candidate(NamedTuple):
    """A colour with Schwarz's criterion."""

    colour: Colour
    criterion: float

    @staticmethod
    def of(series: Series, functions: np.ndarray, drift: bool, lines: tuple[float, ...]) -> "_Candidate":
        """That of a process beside functions of time and the rounding."""
        beside = np.column_stack([functions, series.rounding])
        columns = np.column_stack([series.slopes, beside])
        columns = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), np.finfo(float).tiny)
        coefficients, criterion, sizes = np.zeros(0), np.inf, np.zeros(columns.shape[1])
        left, variance = series.residual, 1.0
        for _ in range(_ROUNDS):
            white = innovations(np.column_stack([series.residual, columns]), series.starts, coefficients)
            standard = _orthonormal(white[:, 1:])
            sizes = -standard @ (standard.T @ (white[:, 1:].T @ white[:, 0]))
            left = series.residual + columns @ sizes
            dof = max(white.shape[0] - standard.shape[1] - coefficients.size, 1)
            variance = float(np.sum((white[:, 0] + white[:, 1:] @ sizes) ** 2)) / dof
            before, (coefficients, criterion) = coefficients, autoregression(left, series.starts)
            if before.shape == coefficients.shape and np.allclose(before, coefficients, rtol=0, atol=1e-3):
                break
        criterion += (beside.shape[1] + len(lines)) * np.log(series.t.size)
        unit = np.sqrt(np.mean(beside**2, axis=0))
        told = sizes[series.slopes.shape[1] :] / np.where(unit > 0, unit, 1.0)
        colour = Colour(coefficients, float(np.sqrt(variance)), left, beside, drift, lines, told)
        return _Candidate(colour, float(criterion))


def white(series: Series, level: float) -> Colour:
    """That of white noise, of which a row has a variance."""
    nothing = np.zeros(0)
    return Colour(nothing, float(np.sqrt(level)), series.residual, np.zeros((series.t.size, 0)), False, (), nothing)


def weighed(series: Series, colour: Colour) -> tuple[np.ndarray, np.ndarray]:
    """Innovations of unit variance, and their derivatives by the coordinates, without what other functions explain."""
    white = whitened(np.column_stack([series.residual, series.slopes, colour.beside]), series, colour)
    p = series.slopes.shape[1] + 1
    told = white[:, :p]
    if colour.beside.size:
        basis = np.linalg.qr(white[:, p:] / np.maximum(np.linalg.norm(white[:, p:], axis=0), 1e-300))[0]
        told = told - basis @ (basis.T @ told)
    return told[:, 0], told[:, 1:]


def whitened(columns: np.ndarray, series: Series, colour: Colour) -> np.ndarray:
    """Columns in the rows of a series, through the filter that makes innovations of unit variance of its noise."""
    if colour.passage is None:
        return innovations(columns, series.starts, colour.coefficients, colour.excited) / colour.std
    return filtered(columns, series.unit, colour.passage, np.array([colour.kicks]))[0][0] / colour.std


def instants(series: Series, colour: Colour) -> np.ndarray:
    """Times of the rows that are left of a series once it is whitened."""
    order = colour.coefficients.size
    if colour.passage is not None or _start(colour.coefficients).shape[0] == order:
        return series.t
    return np.concatenate([part[order:] for part in np.split(series.t, series.starts[1:])])


def autoregressive(series: Series) -> Colour:
    """That of an autoregression of the residuals as they are."""
    coefficients, _ = autoregression(series.residual, series.starts)
    level = float(np.var(innovations(series.residual[:, None], series.starts, coefficients)))
    spread = _spread(coefficients, series.starts, series.t.size)
    return white(series, level)._replace(coefficients=coefficients, spread=spread)


def thinned(series: Series, step: int) -> Series:
    """Every so manieth row."""
    starts = np.unique(-(-series.starts // step))
    t, residual, slopes, unit, _, rounding = (values[::step] for values in series)
    return Series(t, residual, slopes, unit, starts, rounding)


def kicked(series: Series, passage: Passage) -> Colour:
    """That of kicks which a linear system carries on, beside independent noise."""
    kicks, std, spread, left, sides = kicks_of(series.residual, series.slopes, series.unit, passage)
    return white(series, std**2)._replace(left=left, kicks=kicks, spread=spread, passage=passage, sides=sides)


def autoregression(left: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients of the process of the order that Schwarz's criterion chooses, and the criterion.

    White noise is given up for another only where the evidence is very strong.
    """
    return _process(*gram(left, starts, _most(left.size, starts)))


def _most(rows: int, starts: np.ndarray) -> int:
    """The highest order that the longest stretch of rows may tell."""
    return min(_MOST, int(np.max(np.diff(np.append(starts, rows)), initial=0)) // _ROWS)


def _process(gram: np.ndarray, n: int) -> tuple[np.ndarray, float]:
    """The same from sums of products of `n` values with those before them."""
    most = gram.shape[0] - 1
    if n == 0 or not gram[0, 0] > 0:
        return np.zeros(0), np.inf
    lags = gram[1:, 1:] + 1e-13 * gram[0, 0] * np.eye(most)
    lower = np.linalg.cholesky(lags) if most else lags
    # What each further order takes from the sum of squares: one factor serves all orders.
    along = np.linalg.solve(lower, gram[1:, 0])
    squares = gram[0, 0] - np.concatenate([[0.0], np.cumsum(along**2)])
    criteria = n * np.log(np.maximum(squares, 1e-30 * gram[0, 0]) / n) + np.log(n) * np.arange(most + 1)
    criteria[0] -= _STRONG
    order = int(np.argmin(criteria))
    return np.linalg.solve(lower[:order, :order].T, along[:order]), float(criteria[order])


def _without_level(coefficients: np.ndarray, sums: np.ndarray, n: int) -> np.ndarray:
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
    gram, n = np.zeros((most + 1, most + 1)), 0
    for part in np.split(left, starts[1:]):
        if part.size > most:
            gram, n = gram + _products(part, most), n + part.size - most
    return gram, n


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

    The first rows of a stretch, which have too few before them, are weighed by what a stationary process makes of them,
    `excited` as many times as large; one that is not stationary says nothing of its level, and they are left out.
    """
    order = coefficients.size
    if not order:
        return columns
    newest_first, start = np.concatenate([[1.0], -coefficients]), _start(coefficients) / excited
    found = [columns[:0]]
    for part in np.split(columns, starts[1:]):
        found.append(start[: part.shape[0], : part.shape[0]] @ part[:order])
        if part.shape[0] > order:
            windows = np.lib.stride_tricks.sliding_window_view(part, order + 1, axis=0)[..., ::-1]
            found.append(windows @ newest_first)
    return np.concatenate(found)


def _start(coefficients: np.ndarray) -> np.ndarray:
    """What makes the first values of a stationary process as many innovations, shape (order, order).

    Each is predicted by those before it: by the process of so many coefficients, which follows from that of one more
    (Durbin's and Levinson's recursion backwards; Brockwell and Davis, 5.2). Where there is no such process: (0, order).
    """
    order, a, variance = coefficients.size, coefficients, 1.0
    found = np.zeros((order, order))
    for j in range(order - 1, -1, -1):
        last = float(a[j])
        if abs(last) > 1 - _ROUNDING:
            return np.zeros((0, order))
        a, variance = (a[:j] + last * a[:j][::-1]) / (1 - last**2), variance / (1 - last**2)
        found[j, : j + 1] = np.concatenate([-a[::-1], [1.0]]) / np.sqrt(variance)
    return found


def _excited(left: np.ndarray, starts: np.ndarray, coefficients: np.ndarray, std: float) -> float:
    """How many times larger than it is kept up a process starts, as a mode does that the release excites."""
    start, order = _start(coefficients), coefficients.size
    parts = [part[:order] for part in np.split(left, starts[1:])]
    first = np.concatenate([start[: part.size, : part.size] @ part for part in parts])
    return max(float(np.sqrt(np.mean(first**2))) / std, 1.0) if first.size else 1.0


def _spread(coefficients: np.ndarray, starts: np.ndarray, rows: int, excited: float = 1.0) -> float:
    """Sum of the logarithms of the variances of the first values of all stretches over that of the innovations."""
    each = -2 * np.log(np.diag(_start(coefficients)) / excited)
    return float(sum(each[:length].sum() for length in np.diff(np.append(starts, rows))))


def _waves(series: Series, lines: Iterable[float]) -> np.ndarray:
    """Cosine and sine of each line [Hz] in the rows of a series, each a mean over its time; shape (n, 2 lines)."""
    row = float(np.median(np.diff(series.t)))
    waves = [np.sinc(line * row) * f(2 * np.pi * line * series.t) for line in lines for f in (np.cos, np.sin)]
    return np.column_stack(waves) * series.unit[:, None]


def _lines(series: Series, so_far: _Candidate, motion: float) -> tuple[float, ...]:
    """Frequencies of the lines that stand out of the spectrum of what a candidate leaves [Hz], the strongest first."""
    whole = left = so_far.colour.left
    found: list[float] = []
    if left.size < 4 * _NEAR:
        return ()
    for _ in range(_LINES):
        line = _strongest(series.t, left, motion)
        if line is None or any(abs(line - other) * np.ptp(series.t) < _WIDE for other in found):
            break
        found, left = _tuned(series, [*found, line], whole)
    return tuple(found)


def _strongest(t: np.ndarray, left: np.ndarray, motion: float) -> float | None:
    """Frequency of the strongest line of a series to a part of its resolution, None where none stands out."""
    from scipy.fft import next_fast_len

    size = int(next_fast_len(left.size, real=True) or left.size)
    power = np.abs(np.fft.rfft(left * np.hanning(left.size), size)) ** 2
    step = 1 / (size * float(np.median(np.diff(t))))
    apart = np.abs(step * np.arange(power.size) - motion) >= motion / 2
    apart[:_WIDE] = False
    k = int(np.argmax(power * apart))
    near = np.r_[max(k - _NEAR, 1) : max(k - _WIDE, 1), k + _WIDE + 1 : min(k + _NEAR + 1, power.size)]
    if near.size < _NEAR // 2 or power[k] < _LINE * np.median(power[near]):
        return None
    below, at, above = np.log(power[k - 1 : k + 2]) if k + 1 < power.size else (0.0, 1.0, 0.0)
    if below > at:
        return None
    aside = 0.5 * (below - above) / (below - 2 * at + above)
    return (k + aside) * step


def _tuned(series: Series, lines: Sequence[float], left: np.ndarray) -> tuple[list[float], np.ndarray]:
    """The lines with their frequencies by least squares, and what is left beside them.

    With ``a cos + b sin`` the derivative by the angular frequency is ``t (b cos - a sin)``.
    """
    t, found = series.t - series.t.mean(), np.array(lines)
    resolution = 1 / np.ptp(t)
    for _ in range(_TUNINGS):
        waves = [f(2 * np.pi * line * t) * series.unit for line in found for f in (np.cos, np.sin)]
        columns = np.column_stack([*waves, *(t * wave for wave in waves)])
        (a, b), (c, d) = np.linalg.lstsq(columns, left, rcond=None)[0].reshape(2, -1, 2).transpose(0, 2, 1)
        off = (b * c - a * d) / (2 * np.pi * np.maximum(a**2 + b**2, np.finfo(float).tiny))
        found = found + np.clip(off, -resolution / 2, resolution / 2)
    waves = _waves(series, found)
    return found.tolist(), left - waves @ np.linalg.lstsq(waves, left, rcond=None)[0]
