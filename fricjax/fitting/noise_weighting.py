"""The fit counted by the noise that its record has.

The squares of all samples are right for white noise of one size. What a fit leaves tells whether that is so: in rows of
some forty to a half-cycle, short against the motion, so that nothing is lost, and few enough to be quick. Where the
clock jitters the samples are weighed by it and fitted anew (:mod:`.clock`). Where the noise remembers, hums, drifts, or
is a motion of the mass on a floor that shakes, the rows are weighed by that (:mod:`.colours`) and the fit goes on from
their least squares, by steps of Gauss and Newton with another look at the record after each, until nothing changes.

What no noise explains is left as it is: where the model does not describe the record, the errors of white noise grow by
the size of the residuals and the time over which they stay the same.

A record may leave its number of half-cycles open. Each number has an optimum of its own, which describes the record by
odds of ``exp(-chi^2/2)`` to those of the others, none being more likely beforehand. Given as one value with a standard
error, what is known is the moments of that mixture about the best of them (Gelman et al., Bayesian Data Analysis, 2013,
7.6).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.colour import Colour, white, whitened
from ..estimation.covariance import Quadratic
from ..estimation.loss import Squares
from ..estimation.small_sample import small_sample_covariance
from .clock import by_clock
from .colours import colours_of, expected_size, least_squares, misfit_of, under_noise, variance_left, weighed_rows
from .diagnostics import worst
from .evaluation import Block
from .missing import Lacking, allowed_for, explaining, main_forces, responses_in, seen_beside_noise
from .noise import Line, Noise, whiteness
from .problem import Problem
from .responses import Responses
from .rows import Rows, Seen, rounded, rows_of
from .runs import IN_PHASE
from .solve import Solution, checking, evaluate_at, half_cycles
from .window import Window

# Rounds of the fit under coloured noise, those that look at the noise anew, and the step in standard errors that may be
# left. Most fits arrive in three; one that has not in five goes back and forth between two descriptions of the noise.
_ROUNDS, _LOOKS, _NEAR = 8, 5, 0.05


class Other(NamedTuple):
    """Another number of half-cycles of each run, and how probable it is."""

    half_cycles: tuple[int, ...]
    probability: float


class Doubt(NamedTuple):
    """What the other numbers of half-cycles add to the covariance of the coordinates, shape (p, p)."""

    others: tuple[Other, ...]
    covariance: np.ndarray


class End(NamedTuple):
    """The optimum of a number of half-cycles: its sum of squares of unit variance, and its coordinates, shape (p,)."""

    half_cycles: tuple[int, ...]
    misfit: float
    y: np.ndarray


class NoiseWeighted(NamedTuple):
    """A solved fit counted by the noise of its record.

    Attributes:
        problem: the problem, with samples weighed by the jitter of their clock where it shows.
        solution: the fit where it ended; its quadratic form and its normal matrix count by the noise.
        variance: by which the inverse of that form is a covariance.
        scatter: the same for white noise of the size stated, or that of the residuals where none is taken at its word;
            `white`: standard errors of the coordinates under it.
        noises: the noise of each run.
        unsure: what is to be added to that covariance of the coordinates for what the record leaves open of its noise,
            of its number of half-cycles, and of what its model lacks; `others`: the other numbers.
        went_on: whether the fit went on from its least squares.
        gain: what the colour adds to minus twice the logarithm of the likelihood; `numbers`: how many numbers it has.
        lacks: what the model lacks in each run, and what it may lack as well; nothing where it was not looked for.
    """

    problem: Problem
    solution: Solution
    variance: float
    scatter: float
    white: np.ndarray
    noises: tuple[Noise, ...]
    unsure: np.ndarray
    others: tuple[Other, ...] = ()
    went_on: bool = False
    gain: float = 0.0
    numbers: int = 0
    lacks: tuple[Lacking | None, ...] = ()


def weigh_by_noise(problem: Problem, solution: Solution, absolute: bool) -> NoiseWeighted:
    """The fit of least squares, carried on where the noise of a run is not white.

    Args:
        problem: the problem.
        solution: its least squares.
        absolute: whether the size of the noise is taken at its word, as long as the residuals do not contradict it.
    """
    plain = _plain(problem, solution, absolute)
    if not solution.converged or (problem.made and problem.noise == "white"):
        # Of a record made from the model with such noise there is nothing to find.
        return plain
    rows = rows_of(problem, solution.evaluation)
    known = [responses_in(problem, solution, run, row) for run, row in enumerate(rows)]
    lacks = [explaining(problem, solution, run, *each) for run, each in enumerate(zip(rows, known, strict=True))]
    if any(lacks):
        # Memory, or kicks of a floor, would explain in each half-cycle anew what one force does in all of them.
        return _allowing(_undescribed(plain, rows) if problem.noise == "auto" else plain, lacks)
    if problem.noise == "white":
        return _beside(plain, solution, _white(rows), known)
    # What the model lacks grows with velocity too.
    small = _size_of(problem, rows, absolute) <= thresholds.DESCRIBED
    clocked = by_clock(problem, solution, rows) if small and problem.noise in ("auto", "jitter") else None
    if clocked is None:
        return _by_colour(plain, rows, known, absolute)
    rows = rows_of(clocked.problem, clocked.solution.evaluation)
    counted = _by_colour(_plain(clocked.problem, clocked.solution, absolute), rows, known, absolute)
    pairs = zip(counted.noises, clocked.jitters, strict=True)
    return counted._replace(
        white=plain.white,
        noises=tuple(noise if jitter is None else noise._replace(jitter=jitter.time) for noise, jitter in pairs),
        went_on=True,
        gain=counted.gain + clocked.gain,
        numbers=counted.numbers + 2 * sum(jitter is not None for jitter in clocked.jitters),
    )


def _size_of(problem: Problem, rows: Sequence[Rows], absolute: bool) -> float:
    """The size of all residuals over the noise of their run, the most of all runs."""
    sizes = [2 * [float(np.sqrt(row.level))] for row in rows]
    return worst(problem, sizes, [0.0] * len(rows), not absolute).ratio


def _by_colour(
    plain: NoiseWeighted, first: Sequence[Rows], known: Sequence[Responses], absolute: bool
) -> NoiseWeighted:
    """The fit carried on where the noise of a run is coloured.

    Args:
        plain: its least squares.
        first: their rows.
        known: the responses to forces at the times of these rows.
        absolute: as in `weigh_by_noise`.
    """
    problem, solution = plain.problem, plain.solution
    none = np.zeros(problem.residual.n_parameters)
    at, rows, seen, in_doubt = solution, first, [], none
    # A drift that is far larger than the noise makes steps so long that the motion curves within them, and what that
    # leaves is for the next step. Of a misfit that no noise explains, more than a tenth is left.
    on_the_way = max(_size_of(problem, first, absolute) / thresholds.DESCRIBED, thresholds.DESCRIBED)
    for number in range(_ROUNDS):
        if number < _LOOKS:
            seen = colours_of(problem, at, rows, absolute)
        else:
            seen = [Seen(row, colour) for row, (_, colour) in zip(rows, seen, strict=True)]
        if not at.evaluation.residual.size and (seen or any(map(rounded, problem.windows))):
            # Of a lane no residual is left of the samples.
            at = _moved(problem, at, none)
            rows = rows_of(problem, at.evaluation)
            continue
        if not seen:
            return _beside(plain, solution, _white(rows), known)
        least = least_squares(problem, at, weighed_rows(seen))
        ended = at._replace(shape=least[0])
        arrived = ended.shape.distance <= _NEAR
        if not misfit_of(problem, seen, absolute) <= (thresholds.DESCRIBED if arrived else on_the_way):
            return _or_forces(_beside(_undescribed(plain, first), ended, seen, known), plain, first, known)
        if arrived:
            counted = _beside(_under_colour(plain, at, seen, least, in_doubt, absolute), ended, seen, known)
            guessed = problem.noise == "auto" and any(colour.transition for _, colour in seen)
            return _or_forces(counted, plain, first, known) if guessed else counted
        if number == _LOOKS - 1:
            in_doubt = ended.shape.step
        at = _moved(problem, at, ended.shape.step)
        if not np.isfinite(at.evaluation.chi2):
            break
        rows = rows_of(problem, at.evaluation, seen)
        # Where a step leads out of phase with the record, the next ones run off to stiffnesses beyond all numbers.
        if any(map(_out_of_phase, problem.windows, rows, first)):
            break
    return _or_forces(_undescribed(plain, first), plain, first, known)


def _out_of_phase(window: Window, row: Rows, first: Rows) -> bool:
    """Whether a motion is farther from its record than half the amplitude, and than least squares were (`first`)."""
    # A robust loss leaves a row of outliers almost no unit of its own.
    farthest, before = (np.max(np.abs(each.series.residual)) / np.max(each.series.unit) for each in (row, first))
    return bool(farthest > max(IN_PHASE * window.segmentation.amplitude, before))


def _under_colour(
    plain: NoiseWeighted,
    at: Solution,
    seen: Sequence[Seen],
    least: tuple[Quadratic, np.ndarray, np.ndarray],
    in_doubt: np.ndarray,
    absolute: bool,
) -> NoiseWeighted:
    """The fit where it arrived under coloured noise.

    Args:
        plain: its least squares.
        at: where it arrived.
        seen: the noise.
        least: quadratic form, gradient and normal matrix that count by it.
        in_doubt: how far apart two descriptions of the noise lead that are as good as each other, shape (p,).
        absolute: as in `weigh_by_noise`.
    """
    problem, (shape, gradient, normal) = plain.problem, least
    likelihoods = [_likelihood(*run, absolute) for run in seen]
    doubt = _doubt(problem, at, seen)
    few = small_sample_covariance([(row.series, colour) for row, colour in seen], shape.inverse)
    return plain._replace(
        solution=at._replace(
            evaluation=at.evaluation._replace(gradient=gradient, normal=normal),
            shape=shape,
            numerical_shift=max(plain.solution.numerical_shift, shape.distance),
        ),
        variance=1.0,
        unsure=few + doubt.covariance + np.outer(in_doubt, in_doubt),
        others=doubt.others,
        noises=tuple(_noise(window, *run) for window, run in zip(problem.windows, seen, strict=True)),
        went_on=True,
        gain=sum(gain for gain, _ in likelihoods),
        numbers=sum(numbers for _, numbers in likelihoods),
    )


def _white(rows: Sequence[Rows]) -> list[Seen]:
    """Rows with the noise that least squares take them to have."""
    return [Seen(row, white(row.series, 1.0)) for row in rows]


def _beside(weighted: NoiseWeighted, at: Solution, seen: Sequence[Seen], known: Sequence[Responses]) -> NoiseWeighted:
    """The fit with what its model lacks beside the noise that was seen."""
    runs = enumerate(zip(seen, known, strict=True))
    return _allowing(weighted, [seen_beside_noise(weighted.problem, at, run, *each) for run, each in runs])


def _or_forces(
    counted: NoiseWeighted, plain: NoiseWeighted, first: Sequence[Rows], known: Sequence[Responses]
) -> NoiseWeighted:
    """The fit with errors that allow for forces that few half-cycles do not tell from what explains the motion now.

    Args:
        counted: the fit beside kicks of a floor, or beside what no noise explains.
        plain: its least squares, of which the shifts are.
        first: their rows.
        known: the responses to forces at the times of these rows.
    """
    problem, p = counted.problem, counted.problem.residual.n_parameters
    moved, lacks = plain.solution.y[:p] - counted.solution.y[:p], []
    for run, (row, responses) in enumerate(zip(first, known, strict=True)):
        forces = main_forces(problem, plain.solution, run, row, responses)
        lacks += [force._replace(shift=force.shift + moved) for force, _ in forces]
    return _allowing(counted, lacks)._replace(lacks=(*counted.lacks, *lacks))


def _allowing(weighted: NoiseWeighted, lacks: Sequence[Lacking | None]) -> NoiseWeighted:
    """The fit with standard errors that allow for what its model lacks."""
    unsure = weighted.unsure + allowed_for(lacks, weighted.problem.residual.n_parameters)
    return weighted._replace(lacks=tuple(lacks), unsure=unsure)


def _plain(problem: Problem, solution: Solution, absolute: bool) -> NoiseWeighted:
    """The fit with its residuals taken for white noise; that as large as stated is not enlarged."""
    blocks = [Block.of(sums) for sums in solution.evaluation.blocks]
    reduced = solution.chi2 / problem.dof
    if not isinstance(problem.loss, Squares):
        # Mean square of the influences over the mean curvature of the losses (Huber, Robust Statistics, 1981, 7.6).
        squares, curvatures = ([getattr(block, name) for block in blocks] for name in ("square", "curvature"))
        scatter = variance = float(
            np.concatenate(squares).sum(dtype=float) / np.concatenate(curvatures).sum(dtype=float)
        )
    else:
        scatter = 1.0 if absolute else reduced
        variance = reduced if absolute and reduced > 1 + thresholds.SURE * np.sqrt(2 / problem.dof) else scatter
    noises = tuple(Noise(excess=float(np.sqrt(variance))) for _ in blocks)
    ends = [
        End(half_cycles(like), at.foreseen / variance, at.y[: at.shape.step.size] + at.shape.step)
        for like, at in (((problem, solution), *solution.rivals) if solution.rivals else ())
    ]
    doubt = doubt_of(ends, problem.residual.n_parameters)
    white = np.sqrt(np.diag(scatter * solution.shape.inverse + doubt.covariance))
    return NoiseWeighted(problem, solution, variance, scatter, white, noises, doubt.covariance, doubt.others)


def _doubt(problem: Problem, at: Solution, seen: Sequence[Seen]) -> Doubt:
    """The doubt in the number of half-cycles, counted by the noise that was seen with that one."""
    ends = []
    # Alone, the one that was taken is in no doubt, whatever its misfit.
    for like, reached in ((problem, at), *at.rivals) if at.rivals else ():
        alternative = under_noise(like, reached, seen)
        step = alternative.shape.step
        ends.append(End(half_cycles(like), alternative.misfit, reached.y[: step.size] + step))
    return doubt_of(ends, problem.residual.n_parameters)


def _undescribed(plain: NoiseWeighted, rows: Sequence[Rows]) -> NoiseWeighted:
    """The fit of least squares, its errors enlarged for residuals that are no noise, as large as they are in motion."""
    pairs = zip(plain.problem.windows, rows, strict=True)
    moving = [row.series.residual[row.series.t <= window.stopped] for window, row in pairs]
    times = [whiteness(left).correlation_time for left in moving]
    sizes = [float(np.mean(left**2)) for left in moving]
    noises = tuple(
        Noise(excess=float(np.sqrt(row.level)), memory=float(time) * row.samples * row.interval)
        for row, time in zip(rows, times, strict=True)
    )
    variance = max(time * size for time, size in zip(times, sizes, strict=True))
    return plain._replace(variance=max(variance, plain.variance), noises=noises)


def _moved(problem: Problem, at: Solution, step: np.ndarray) -> Solution:
    """A look at the record a step further."""
    p, limits = step.size, problem.limits
    y = np.concatenate([np.clip(at.y[:p] + step, limits.lower, limits.upper), at.y[p:]])
    looked = evaluate_at(problem, checking(problem.residual, y), y)
    return at._replace(y=y, evaluation=looked.evaluation, derived=looked.derived, passes=at.passes + 1)


def _noise(window: Window, row: Rows, colour: Colour) -> Noise:
    """A colour in the terms of the user."""
    t, order = row.series.t, colour.coefficients.size
    largest = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -colour.coefficients]))), initial=0.0))
    walks = largest >= 1 or not colour.has_level
    memory = 0.0 if not order else np.inf if walks else -row.samples * row.interval / np.log(largest)
    return Noise(
        excess=float(np.sqrt(variance_left(row, colour))),
        memory=float(memory),
        rounding=window.segmentation.resolution if row.series.rounding.size and colour.beside.size else 0.0,
        drift=colour.speed(t),
        middle=float(t.mean()),
        lines=tuple(Line(f, *map(float, pair)) for f, pair in zip(colour.lines, colour.waves, strict=True)),
        expected=expected_size(window, row, colour),
        floor=2 * colour.kicks * colour.std**2,
    )


def _likelihood(row: Rows, colour: Colour, absolute: bool) -> tuple[float, int]:
    """What a colour adds to minus twice the logarithm of the likelihood of white noise, and how many numbers it has."""
    residual, unit = row.series.residual, 1.0 if absolute else row.level
    counted = float(np.sum(whitened(row.series, colour)[0] ** 2)) + colour.log_determinant
    return counted - float(residual @ residual) / unit - residual.size * np.log(unit), colour.n_parameters


def doubt_of(ends: Sequence[End], parameters: int) -> Doubt:
    """The doubt in the first of several numbers of half-cycles, which is that taken; none where there are no others."""
    if not ends:
        return Doubt((), np.zeros((parameters, parameters)))
    misfits = np.array([end.misfit for end in ends])
    odds = np.exp(-(misfits - misfits.min()) / 2)
    probabilities = odds / odds.sum()
    moves = np.array([end.y - ends[0].y for end in ends])
    others = [Other(end.half_cycles, float(p)) for end, p in zip(ends[1:], probabilities[1:], strict=True)]
    return Doubt(tuple(others), (moves.T * probabilities) @ moves)
