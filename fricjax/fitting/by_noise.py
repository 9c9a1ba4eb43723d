"""The fit counted by the noise that its record has.

The squares of all samples are right for white noise of one size. What a fit leaves tells whether that is so: in rows of
some forty to a half-cycle, short against the motion, so that nothing is lost, and few enough to be quick. Where the
noise remembers, hums, drifts, or grows with the velocity as that of a jittering clock does, the rows are weighed by it
(:mod:`~fricjax.estimation.colour`) and the fit goes on from their least squares, by steps of Gauss and Newton with
another look at the record after each, until nothing changes any more.

What no noise explains is left as it is: where the model does not describe the record, the errors of white noise grow by
the size of the residuals and the time over which they stay the same.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data.noise import NORMAL_MAD
from ..estimation.colour import (
    Colour,
    Series,
    autoregression,
    autoregressive,
    colour_of,
    innovations,
    kicked,
    size_of,
    thinned,
    weighed,
    white,
)
from ..estimation.loss import Squares
from ..estimation.quadratic import Quadratic, quadratic
from .clock import by_clock
from .floor import passage_of
from .noise import Line, Noise
from .problem import Problem
from .rows import Rows, rows_of, run_in_rows
from .solve import Solved, checking, look
from .survey import Block
from .verdict import ADEQUATE, worst
from .whiteness import whiteness
from .window import Window

# Standard errors from which on noise larger than stated, or one that goes with the velocity, is believed.
_SURE = 5.0
# Rounds until step and colour settle, and the step in standard errors that is left then.
_ROUNDS, _NEAR = 8, 0.05
# Rows by which a floor that shakes is looked for first, for its filter takes them one by one.
_FEW = 600
# Rows of a rest that tell its noise.
_RESTING = 64
# Solutions until the weights of a jittering clock settle, and the factor by which the noise at rest may fall in each.
_CLOCKED, _STEP = 6, 10.0
# Rows that tell a jitter, rounds in which their weights settle, and the part of them that is the quietest.
_FEWEST, _REWEIGHED, _QUIET = 16, 6, 0.1


class Counted(NamedTuple):
    """A solved fit counted by the noise of its record.

    Attributes:
        problem: the problem, with samples weighed by the jitter of their clock where it shows.
        solved: the fit where it ended; its quadratic form and its normal matrix count by the noise.
        variance: by which the inverse of that form is a covariance.
        scatter: the same for white noise of the size stated, or that of the residuals where none is taken at its word;
            `white`: standard errors of the coordinates under it.
        noises: the noise of each run.
        went_on: whether the fit went on from its least squares.
        gain: what the colour adds to minus twice the logarithm of the likelihood; `numbers`: how many numbers it has.
    """

    problem: Problem
    solved: Solved
    variance: float
    scatter: float
    white: np.ndarray
    noises: tuple[Noise, ...]
    went_on: bool = False
    gain: float = 0.0
    numbers: int = 0


class Seen(NamedTuple):
    """The rows of a run and the colour of their noise."""

    rows: Rows
    colour: Colour


def counted_by_noise(problem: Problem, solved: Solved, absolute: bool) -> Counted:
    """The fit of least squares, carried on where the noise of a run is not white.

    Args:
        problem: the problem.
        solved: its least squares.
        absolute: whether the size of the noise is taken at its word, as long as the residuals do not contradict it.
    """
    plain = _plain(problem, solved, absolute)
    if not solved.converged:
        return plain
    rows = rows_of(problem, solved.survey)
    # What the model lacks grows with velocity too.
    small = (
        worst(problem, [float(np.sqrt(row.level)) for row in rows], [0.0] * len(rows), not absolute).ratio <= ADEQUATE
    )
    clocked = by_clock(problem, solved, rows) if small else None
    if clocked is None:
        return _by_colour(plain, rows, absolute)
    rows = rows_of(clocked.problem, clocked.solved.survey)
    counted = _by_colour(_plain(clocked.problem, clocked.solved, absolute), rows, absolute)
    pairs = zip(counted.noises, clocked.jitters, strict=True)
    return counted._replace(
        white=plain.white,
        noises=tuple(noise if jitter is None else noise._replace(jitter=jitter.time) for noise, jitter in pairs),
        went_on=True,
        gain=counted.gain + clocked.gain,
        numbers=counted.numbers + 2 * sum(jitter is not None for jitter in clocked.jitters),
    )


def _by_colour(plain: Counted, white: Sequence[Rows], absolute: bool) -> Counted:
    """The fit carried on where the noise of a run is coloured; `white` are the rows of its least squares."""
    problem, solved = plain.problem, plain.solved
    at, rows = solved, white
    for _ in range(_ROUNDS):
        seen = colours_of(problem, at, rows, absolute)
        if not seen:
            return plain
        if not described(problem, seen, absolute):
            break
        shape, gradient, normal = _least_squares(problem, at, seen)
        if not shape.distance > _NEAR:
            counts = at.survey._replace(gradient=gradient, normal=normal)
            shift = max(solved.numerical_shift, shape.distance)
            told = [_likelihood(*run, absolute) for run in seen]
            return plain._replace(
                solved=at._replace(survey=counts, shape=shape, numerical_shift=shift),
                variance=1.0,
                noises=tuple(_noise(window, *run) for window, run in zip(problem.windows, seen, strict=True)),
                went_on=True,
                gain=sum(gain for gain, _ in told),
                numbers=sum(numbers for _, numbers in told),
            )
        at = _moved(problem, at, shape.step)
        if not np.isfinite(at.survey.chi2):
            break
        rows = rows_of(problem, at.survey)
    return _undescribed(plain, white)


def colours_of(problem: Problem, at: Solved, rows: Sequence[Rows], absolute: bool) -> list[Seen]:
    """The rows of each run with the colour of their noise; none where that of all runs is white."""
    freedom = problem.n_used / problem.dof
    colours = [
        colour_of(row.series, freedom * row.level, "drift" not in window.nuisances, window.segmentation.frequency)
        for row, window in zip(rows, problem.windows, strict=True)
    ]
    if not any(colours):
        return []
    stated, seen = absolute and isinstance(problem.loss, Squares), []
    for run, (row, colour) in enumerate(zip(rows, colours, strict=True)):
        known = white(row.series, _level(row, stated)) if colour is None else _or_shaken(problem, at, run, row, colour)
        seen.append(Seen(row, known))
    return seen


def described(problem: Problem, seen: Sequence[Seen], absolute: bool) -> bool:
    """Whether what is left beside drift and hum is as small as noise in every run."""
    sizes = [float(np.sqrt(_left(*run))) for run in seen]
    expected = [_expected(window, *run) for window, run in zip(problem.windows, seen, strict=True)]
    return worst(problem, sizes, expected, not absolute).ratio <= ADEQUATE


def _or_shaken(problem: Problem, at: Solved, run: int, row: Rows, colour: Colour) -> Colour:
    """A colour, or that of a floor that shakes the mass, by Schwarz's criterion; first by a part of the rows."""
    # No floor moves the reading of a mass that rests, and none is as even as a drift or a hum.
    if not colour.coefficients.size or _wanders(colour.left[_at_rest(problem.windows[run], row)]):
        return colour
    few = thinned(row.series, max(row.series.t.size // _FEW, 1))
    left = thinned(row.series._replace(residual=colour.left), max(row.series.t.size // _FEW, 1))
    rival = _shaken(problem, at, run, few)
    if rival is None or _criterion(few, rival) > _criterion(few, autoregressive(left)):
        return colour
    rival = _shaken(problem, at, run, row.series)
    return colour if rival is None or _criterion(row.series, rival) > _criterion(row.series, colour) else rival


def _wanders(resting: np.ndarray) -> bool:
    """Whether the reading of a rest is coloured beside a straight line; of a short one that is not known."""
    if resting.size < _RESTING:
        return False
    line = np.polynomial.Polynomial.fit(np.arange(resting.size), resting, 1)(np.arange(resting.size))
    return autoregression(resting - line, np.zeros(1, int))[0].size > 0


def _shaken(problem: Problem, at: Solved, run: int, series: Series) -> Colour | None:
    passage = passage_of(problem, at, run, series.t)
    return None if passage is None else kicked(series, passage)


def _criterion(series: Series, colour: Colour) -> float:
    """Schwarz's criterion."""
    return size_of(series, colour) + np.log(series.t.size) * colour.numbers


def misfit_by_noise(problem: Problem, solved: Solved, seen: Sequence[Seen]) -> float:
    """Sum of squares of a fit and its priors, least under noises that were seen elsewhere on the same samples."""
    rows = [run_in_rows(problem, solved.survey, run, like.rows.samples) for run, like in enumerate(seen)]
    runs = [Seen(row, like.colour) for row, like in zip(rows, seen, strict=True)]
    priors = (solved.settled.values - problem.residual.prior_mean) * problem.residual.prior_weight
    counted = sum(float(np.sum(weighed(row.series, colour)[0] ** 2)) for row, colour in runs)
    return counted + float(priors @ priors) - _least_squares(problem, solved, runs)[0].distance ** 2


def remembered(rows: Rows, colour: Colour) -> float:
    """Samples that tell as much as one: the spectral density of the noise at zero over that of independent samples."""
    forgets = max(1 - float(np.sum(colour.coefficients)), np.finfo(float).eps)
    return min(max((colour.std / forgets) ** 2 / rows.level, 1.0), rows.series.t.size * rows.samples / 2)


def _plain(problem: Problem, solved: Solved, absolute: bool) -> Counted:
    """The fit with its residuals taken for white noise; that as large as stated is not enlarged."""
    blocks = [Block.of(sums) for sums in solved.survey.blocks]
    reduced = solved.chi2 / problem.dof
    if not isinstance(problem.loss, Squares):
        # Mean square of the influences over the mean curvature of the losses (Huber, Robust Statistics, 1981, 7.6).
        squares, curvatures = zip(*((block.square, block.curvature) for block in blocks), strict=True)
        scatter = variance = float(
            np.concatenate(squares).sum(dtype=float) / np.concatenate(curvatures).sum(dtype=float)
        )
    else:
        scatter = 1.0 if absolute else reduced
        variance = reduced if absolute and reduced > 1 + _SURE * np.sqrt(2 / problem.dof) else scatter
    noises = tuple(Noise(excess=float(np.sqrt(variance))) for _ in blocks)
    return Counted(problem, solved, variance, scatter, np.sqrt(scatter * np.diag(solved.shape.inverse)), noises)


def _undescribed(plain: Counted, rows: Sequence[Rows]) -> Counted:
    """The fit of least squares, its errors enlarged for residuals that are no noise."""
    times = [whiteness(row.series.residual).correlation_time for row in rows]
    sizes = [float(np.mean(row.series.residual**2)) for row in rows]
    noises = tuple(
        Noise(excess=np.sqrt(row.level), memory=time * row.samples * row.interval)
        for row, time in zip(rows, times, strict=True)
    )
    variance = max(time * size for time, size in zip(times, sizes, strict=True))
    return plain._replace(variance=max(variance, plain.variance), noises=noises)


def _left(row: Rows, colour: Colour) -> float:
    """Variance of the samples without a drift and a hum, in that stated."""
    removed = float(np.mean(row.series.residual**2) - np.mean(colour.left**2)) / row.samples
    return max(row.level - removed, 0.0)


def _expected(window: Window, row: Rows, colour: Colour) -> float:
    """Standard deviation that the noise of the rest would have all over the run, in that stated; zero where unknown.

    Noise that wanders slowly is larger over a run than in any piece of it. Whether it may be noise is told by its
    innovations: those that the process of the rest leaves in the motion are then no larger than those in the rest.
    """
    if colour.passage is not None:
        told = whiteness(weighed(row.series._replace(residual=colour.left), colour)[0]).white
        return float(np.sqrt(_left(row, colour))) if told else 0.0
    still = _at_rest(window, row)
    if np.sum(still) < _RESTING or still.all():
        return 0.0
    begin = np.zeros(1, int)
    coefficients, _ = autoregression(colour.left[still], begin)
    moving, resting = (innovations(colour.left[part, None], begin, coefficients) for part in (~still, still))
    # By medians, for spikes in the rest are no noise that wanders; a random walk grows with the root of time.
    parts = resting, colour.left[still]
    typical, seen = (float(np.median(np.abs(part - np.median(part)))) / NORMAL_MAD for part in parts)
    told = np.sqrt(_left(row, colour)) * typical / max(np.std(moving), np.finfo(float).tiny)
    return float(min(told, seen * np.sqrt(still.size / np.sum(still) / row.samples)))


def _at_rest(window: Window, row: Rows) -> np.ndarray:
    """Which rows lie in the rest."""
    rest = window.segmentation.rest
    return row.series.t > (np.inf if rest is None else rest - window.origin)


def _level(row: Rows, stated: bool) -> float:
    """Variance of white noise: that `stated`, where it is and the residuals do not contradict it."""
    enough = 1 + _SURE * np.sqrt(2 / (row.series.t.size * row.samples))
    return 1.0 if stated and row.level < enough else row.level


def _least_squares(problem: Problem, at: Solved, seen: Sequence[Seen]) -> tuple[Quadratic, np.ndarray, np.ndarray]:
    """Quadratic form, gradient and normal matrix of the rows weighed by their colours, and of the priors."""
    residual, limits = problem.residual, problem.limits
    p, n = residual.n_parameters, at.y.size
    weight = np.asarray(residual.prior_weight)
    slope = np.pad(at.settled.slope * weight, (0, n - p))
    normal = np.diag(slope**2)
    gradient = slope * np.pad((at.settled.values - residual.prior_mean) * weight, (0, n - p))
    for row, colour in seen:
        r, slopes = weighed(row.series, colour)
        gradient, normal = gradient + slopes.T @ r, normal + slopes.T @ slopes
    y, down = at.y[:p], gradient[:p]
    held = ((y <= limits.lower) & (down >= 0)) | ((y >= limits.upper) & (down <= 0))
    return quadratic(down, normal[:p, :p], held), gradient, normal


def _moved(problem: Problem, at: Solved, step: np.ndarray) -> Solved:
    """A look at the record a step further."""
    p, limits = step.size, problem.limits
    y = np.concatenate([np.clip(at.y[:p] + step, limits.lower, limits.upper), at.y[p:]])
    looked = look(problem, checking(problem.residual, y), y)
    return at._replace(y=y, survey=looked.survey, settled=looked.settled, passes=at.passes + 1)


def _noise(window: Window, row: Rows, colour: Colour) -> Noise:
    """A colour in the terms of the user."""
    t, order = row.series.t, colour.coefficients.size
    largest = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -colour.coefficients]))), initial=0.0))
    memory = 0.0 if not order else np.inf if largest >= 1 else -row.samples * row.interval / np.log(largest)
    waves = colour.sizes[int(colour.drift) :].reshape(-1, 2)
    return Noise(
        excess=float(np.sqrt(_left(row, colour))),
        memory=float(memory),
        drift=float(colour.sizes[0] / np.ptp(t)) if colour.drift else 0.0,
        middle=float(t.mean()),
        lines=tuple(Line(f, *map(float, pair)) for f, pair in zip(colour.lines, waves, strict=True)),
        expected=_expected(window, row, colour),
        floor=2 * colour.kicks * colour.std**2,
    )


def _likelihood(row: Rows, colour: Colour, absolute: bool) -> tuple[float, int]:
    """What a colour adds to minus twice the logarithm of the likelihood of white noise, and how many numbers it has."""
    residual, unit = row.series.residual, 1.0 if absolute else row.level
    counted = float(np.sum(weighed(row.series, colour)[0] ** 2)) + size_of(row.series, colour)
    return counted - float(residual @ residual) / unit - residual.size * np.log(unit), colour.numbers
