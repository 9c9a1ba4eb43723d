"""The noise of each run as its rows show it, and least squares that count by it.

Noise that remembers, a drift and a hum are identified from the residuals alone (:mod:`~fricjax.estimation.colour`). A
floor that shakes is identified by what its kicks would make of the motion; it is looked for where the noise remembers
in motion and not at rest. What is far larger than noise is no noise, whatever would explain it.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data.segmentation.noise import NORMAL_MAD
from ..estimation.autoregression import autoregression, innovations
from ..estimation.colour import (
    Colour,
    Series,
    autoregressive,
    colour_of,
    instants,
    process_of_noise,
    white,
    whitened,
)
from ..estimation.covariance import Quadratic, quadratic
from ..estimation.loss import Squares
from .diagnostics import worst
from .floor import first_rows, kicked, kicked_until, passage_of
from .noise import whiteness
from .problem import Problem
from .rows import Rows, Seen, run_in_rows
from .solve import Solution
from .window import Window

# Part of a derivative that parameters do not explain, from which on it is a function of its own. Convention: they are
# computed to a part in 10^9 of themselves, and what is a function of its own differs by far more.
_OF_ITS_OWN = 1e-6
# Rows of a rest that tell its noise.
_RESTING = 64
# Rows of a piece of it that tell white noise, and the most pieces that are looked at.
_PIECE, _PIECES = 32, 8
# Rows on either side of a step in a rest whose means tell it: a slide is over within about as many, a tenth of a
# half-cycle, for a floor that can move a resting mass does so by its highest frequencies.
_BESIDE = 4


def colours_of(problem: Problem, at: Solution, rows: Sequence[Rows], absolute: bool) -> list[Seen]:
    """The rows of each run with the colour of their noise; none where that of all runs is white.

    The noise model of the problem says which colours may be: all, no motion of the floor, or that alone.
    """
    if problem.noise in ("white", "jitter"):
        return []
    freedom = problem.n_used / problem.dof
    identified = [_identified(row, at.shape.at_bound) for row in rows]
    first = [_without_floor(problem, run, row, freedom * row.level) for run, row in enumerate(identified)]
    stated, seen = absolute and isinstance(problem.loss, Squares), []
    for run, (row, colour) in enumerate(zip(identified, first, strict=True)):
        known = white(row.series, _level(row, stated)) if colour is None else colour
        seen.append(Seen(rows[run], _or_shaken(problem, at, run, row, known)))
    return seen if any(first) or any(colour.transition for _, colour in seen) else []


def _identified(row: Rows, at_bound: np.ndarray) -> Rows:
    """Rows with the derivatives by what may explain some of what is left.

    A coordinate that a bound holds does not. An input of the rig, as the nonlinearity of an interferometer, may, and is
    then no noise besides; but a mass does nothing that free parameters do not, and the rounding in which it differs
    from them would pass for a function of its own.
    """
    slopes, p = row.series.slopes, at_bound.size
    slopes = np.column_stack([slopes[:, :p] * ~at_bound, slopes[:, p:]])
    unit = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    columns = slopes / unit
    apart = columns[:, p:] - columns[:, :p] @ np.linalg.lstsq(columns[:, :p], columns[:, p:], rcond=1e-9)[0]
    slopes[:, p:] *= np.linalg.norm(apart, axis=0) > _OF_ITS_OWN
    return row._replace(series=row.series._replace(slopes=slopes))


def _without_floor(problem: Problem, run: int, row: Rows, level: float) -> Colour | None:
    """The colour of a run as far as no floor is in it, None for white noise or where it is a floor's by its name."""
    if problem.noise == "floor":
        return None
    if problem.noise == "autoregressive":
        return process_of_noise(row.series, level)
    window = problem.windows[run]
    return colour_of(row.series, level, "drift" not in window.nuisances, window.segmentation.frequency)


def misfit_of(problem: Problem, seen: Sequence[Seen], absolute: bool) -> float:
    """What is left beside drift and hum over the noise of its run: the most of all runs, and of the motion of each."""
    sizes = [
        [float(np.sqrt(variance_left(*run, until=time))) for time in (np.inf, window.stopped)]
        for window, run in zip(problem.windows, seen, strict=True)
    ]
    expected = [expected_size(window, *run) for window, run in zip(problem.windows, seen, strict=True)]
    return worst(problem, sizes, expected, not absolute).ratio


def _or_shaken(problem: Problem, at: Solution, run: int, row: Rows, colour: Colour) -> Colour:
    """A colour, or that of a floor that shakes the mass, by Schwarz's criterion."""
    if problem.noise != "auto":
        named = _shaken(problem, at, run, row.series) if problem.noise == "floor" else None
        return colour if named is None else named
    still = _at_rest(problem.windows[run], row)
    # What costs the most comes last: most records hold white noise, which ends here.
    if not (still.any() and _remembers(colour.left[~still], row.level) and _tells_kicks(colour.left[still])):
        return colour
    rival = _shaken(problem, at, run, row.series)
    if rival is None or rival.transition is None:
        return colour
    left = row.series._replace(residual=colour.left)
    known, other = rival, colour if colour.coefficients.size else autoregressive(left)
    if rival.last is not None:
        if rival.last <= row.series.slopes.shape[1]:
            # The floor has led too far from the motion at once: as many parameters fit such rows without any noise.
            return colour
        # Where the floor has led too far from the motion, neither model is to be judged.
        series, passage = first_rows(row.series, rival.last), rival.transition.first(rival.last)
        known, other = kicked_until(series, passage, rival.last), autoregressive(first_rows(left, rival.last))
    return colour if _criterion(known) > _criterion(other) else rival


def by_kicks(problem: Problem, at: Solution, run: int, row: Rows) -> Seen | None:
    """The rows of a run with white kicks of a floor as their noise; None where its rest tells of none."""
    if not _tells_kicks(row.series.residual[_at_rest(problem.windows[run], row)]):
        return None
    colour = _shaken(problem, at, run, _identified(row, at.shape.at_bound).series)
    # A process of the kicks would take for their memory what a force does in all half-cycles.
    return None if colour is None else Seen(row, colour._replace(shape=np.zeros(0), shape_std=1.0))


def _tells_kicks(resting: np.ndarray) -> bool:
    """Whether a rest is long and quiet enough to tell kicks from what a model lacks: no floor moves a reading in it.

    Quiet is one that is white beside a straight line, in most pieces of it. A floor may bring a mass that stopped near
    the edge of its dead band to slide on a little, now and then. What lies between two slides is looked at, for noise
    that remembers does so all the time.
    """
    if resting.size < _RESTING:
        return False
    stretches = [stretch for stretch in _between_slides(resting) if stretch.size >= _PIECE]
    pieces = [piece for stretch in stretches for piece in np.array_split(stretch, min(stretch.size // _PIECE, _PIECES))]
    return sum(map(_is_white, pieces)) > len(pieces) / 2


def _between_slides(resting: np.ndarray) -> list[np.ndarray]:
    """The rows of a rest without those about a step, which is an outlier among the differences of neighbouring means.

    By medians, so that differences of all kinds of steady noise, and of a drift, have no outliers.
    """
    sums, ends = np.concatenate([[0.0], np.cumsum(resting)]), np.arange(_BESIDE, resting.size - _BESIDE + 1)
    steps = sums[ends + _BESIDE] - 2 * sums[ends] + sums[ends - _BESIDE]
    off = np.abs(steps - np.median(steps))
    still = np.ones(resting.size + 2, bool)
    for end in ends[off > thresholds.EXTREME * np.median(off) / NORMAL_MAD]:
        still[end - _BESIDE + 1 : end + _BESIDE + 1] = False
    still[[0, -1]] = False
    edges = np.flatnonzero(np.diff(still))
    return [resting[begin:end] for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def _is_white(rows: np.ndarray) -> bool:
    line = np.polynomial.Polynomial.fit(np.arange(rows.size), rows, 1)(np.arange(rows.size))
    return autoregression(rows - line, np.zeros(1, int))[0].size == 0


def _remembers(moving: np.ndarray, level: float) -> bool:
    """Whether what is left in motion is coloured, or larger than white noise of the run; a long rest hides that."""
    if moving.size == 0:
        return False
    larger = np.mean(moving**2) > level * (1 + thresholds.SURE * np.sqrt(2 / moving.size))
    return bool(larger or autoregression(moving, np.zeros(1, int))[0].size)


def _shaken(problem: Problem, at: Solution, run: int, series: Series) -> Colour | None:
    passage = passage_of(problem, at, run, series.t)
    return None if passage is None else kicked(series, passage)


def _criterion(colour: Colour) -> float:
    """Schwarz's criterion; how a process starts is left out, for what a model lacks starts like a shaken motion."""
    size = colour.log_determinant - (colour.spread if colour.transition is None else 0.0)
    return size + np.log(colour.left.size) * colour.n_parameters


def remembered(rows: Rows, colour: Colour) -> float:
    """Samples that tell as much as one: the spectral density of the noise at zero over that of independent samples."""
    fading = max(1 - float(np.sum(colour.coefficients)), np.finfo(float).eps)
    return min(max((colour.std / fading) ** 2 / rows.level, 1.0), rows.series.t.size * rows.samples / 2)


class UnderNoise(NamedTuple):
    """A fit weighed by noises that were seen elsewhere on the same samples.

    Attributes:
        misfit: sum of squares of its rows, weighed by the noise, and of its priors, where it is the least.
        shape: the quadratic form that leads there from where the fit is.
        times, residuals: of the rows of each run there, the latter of unit variance.
    """

    misfit: float
    shape: Quadratic
    times: list[np.ndarray]
    residuals: list[np.ndarray]


def under_noise(problem: Problem, solution: Solution, seen: Sequence[Seen]) -> UnderNoise:
    """A fit weighed by noises, one for each run."""
    pairs = enumerate(seen)
    runs = [Seen(run_in_rows(problem, solution.evaluation, run, like.rows.samples), like.colour) for run, like in pairs]
    counted = weighed_rows(runs)
    shape, *_ = least_squares(problem, solution, counted)
    priors = (solution.derived.values - problem.residual.prior_mean) * problem.residual.prior_weight
    squares = sum(float(np.sum(residual**2)) for residual, _ in counted) + float(priors @ priors)
    step = np.concatenate([shape.step, np.zeros(solution.y.size - shape.step.size)])
    left = [residual + slopes @ step for residual, slopes in counted[: len(runs)]]
    times = [instants(row.series, colour) for row, colour in runs]
    return UnderNoise(squares - shape.distance**2, shape, times, left)


Weighed = tuple[np.ndarray, np.ndarray]
"""Residuals of unit variance, shape (n,), and their derivatives by the coordinates, shape (n, p)."""


def weighed_rows(seen: Sequence[Seen]) -> list[Weighed]:
    """The rows of each run weighed by their noise, and the mean of each noise that remembers, over its size.

    Noise that hardly forgets does not tell the level about which it wanders: the fit lies in the middle of its record.
    """
    rows = [whitened(row.series, colour) for row, colour in seen]
    for series, colour in ((row.series, colour) for row, colour in seen if colour.coefficients.size):
        residual, size = series.residual + colour.beside @ colour.sizes, float(np.std(colour.left / series.unit))
        middle = series.unit / (series.unit @ series.unit) / size
        rows.append((middle[None] @ residual, middle[None] @ series.slopes))
    return rows


def least_squares(
    problem: Problem, at: Solution, counted: Iterable[Weighed]
) -> tuple[Quadratic, np.ndarray, np.ndarray]:
    """Quadratic form, gradient and normal matrix of weighed residuals and of the priors."""
    residual, limits = problem.residual, problem.limits
    p, n = residual.n_parameters, at.y.size
    weight = np.asarray(residual.prior_weight)
    slope = np.pad(at.derived.slope * weight, (0, n - p))
    normal = np.diag(slope**2)
    gradient = slope * np.pad((at.derived.values - residual.prior_mean) * weight, (0, n - p))
    for r, slopes in counted:
        gradient, normal = gradient + slopes.T @ r, normal + slopes.T @ slopes
    y, down = at.y[:p], gradient[:p]
    at_bound = ((y <= limits.lower) & (down >= 0)) | ((y >= limits.upper) & (down <= 0))
    return quadratic(down, normal[:p, :p], at_bound), gradient, normal


def variance_left(row: Rows, colour: Colour, until: float = np.inf) -> float:
    """Variance of the samples up to a time [s] without a drift, a hum and a level, in that stated.

    Drift and hum are taken from the samples, for rows do not show all of them; what else the rows have less of is the
    motion that is not fitted anew yet.
    """
    series, used = row.series, (row.weight > 0) & (row.t <= until)
    samples = (row.left + colour.at(row.t, series.t) * row.weight)[used]
    before = series.residual + colour.beside @ colour.sizes
    after = colour.left
    if colour.coefficients.size:
        # The level about which noise that remembers wanders means nothing.
        after = after - series.unit * (series.unit @ after) / (series.unit @ series.unit)
    moved = float(np.mean((before**2 - after**2)[series.t <= until])) / row.samples
    return max(float(np.mean(samples**2)) - moved, 0.0)


def expected_size(window: Window, row: Rows, colour: Colour) -> float:
    """Standard deviation that the noise of the rest would have all over the run, in that stated; zero where unknown.

    Noise that wanders slowly is larger over a run than in any piece of it. Whether it may be noise follows from its
    innovations: those that the process of the rest leaves in the motion are then no larger than those in the rest.
    """
    if colour.transition is not None:
        size = whiteness(whitened(row.series._replace(residual=colour.left), colour)[0]).white
        return float(np.sqrt(variance_left(row, colour))) if size else 0.0
    still = _at_rest(window, row)
    if np.sum(still) < _RESTING or still.all():
        return 0.0
    begin = np.zeros(1, int)
    coefficients, _ = autoregression(colour.left[still], begin)
    # Without the first rows, which the release may have excited.
    parts = [innovations(colour.left[part, None], begin, coefficients) for part in (~still, still)]
    moving, resting = (part[coefficients.size :] for part in parts)
    # By medians, for spikes in the rest are no noise that wanders; a random walk grows with the root of time.
    parts = resting, colour.left[still]
    typical, seen = (float(np.median(np.abs(part - np.median(part)))) / NORMAL_MAD for part in parts)
    size = np.sqrt(variance_left(row, colour)) * typical / max(np.std(moving), np.finfo(float).tiny)
    return float(min(size, seen * np.sqrt(still.size / np.sum(still) / row.samples)))


def _at_rest(window: Window, row: Rows) -> np.ndarray:
    """Which rows lie in the rest."""
    return row.series.t > window.stopped


def _level(row: Rows, stated: bool) -> float:
    """Variance of white noise: that `stated`, where it is and the residuals do not contradict it."""
    enough = 1 + thresholds.SURE * np.sqrt(2 / (row.series.t.size * row.samples))
    return 1.0 if stated and row.level < enough else row.level
