"""Generalised least squares: the fit weighted by the noise of its record.

Least squares assumes white noise of constant variance. We test the residuals, averaged into about 40 rows per
half-cycle: short against the motion, so that no information is lost, and few, so that the test is fast. If the clock
jitters, the samples are weighted accordingly and fitted again (:mod:`.clock`). If the noise is correlated, or contains
a hum, a drift or floor vibration, the rows are weighted by a noise model (:mod:`.colours`). The fit then continues with
Gauss-Newton steps, and the noise model is updated after each step until it converges.

If the model does not describe the record, the fit of least squares is kept. Its errors then grow with the size of the
residuals and with their correlation time.

A record may leave its number of half-cycles uncertain. Each number has a separate optimum with the likelihood
``exp(-chi^2/2)``, and all numbers have equal prior probabilities. The reported covariance is the second moment of this
mixture about the best optimum (Gelman et al., Bayesian Data Analysis, 2013, 7.6).
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.colour import Colour, whitened
from ..estimation.covariance import Quadratic
from ..estimation.loss import Squares
from ..estimation.small_sample import small_sample_covariance
from .clock import fit_timing_jitter
from .colours import colours_of, expected_size, least_squares, misfit_of, under_noise, variance_left, weighed_rows
from .diagnostics import noise_level, worst
from .evaluation import Block
from .noise import Line, Noise, whiteness
from .problem import Problem, with_windows
from .rows import Rows, Seen, rounded, rows_of
from .runs import IN_PHASE
from .solve import Solution, checking, evaluate_at, half_cycles, solve
from .window import ESTIMATED, OF_RESIDUALS, Window

# Largest number of iterations, those that update the noise model, and the largest last step in standard errors. Most
# fits need three; one that has not converged after five alternates between two noise models.
_ROUNDS, _LOOKS, _NEAR = 8, 5, 0.05


class AlternativeCount(NamedTuple):
    """Another number of half-cycles of each run, and its probability."""

    half_cycles: tuple[int, ...]
    probability: float


class CountPosterior(NamedTuple):
    """Posterior of the half-cycle counts, and their covariance, shape (p, p).

    The covariance is to be added to that of the coordinates.
    """

    others: tuple[AlternativeCount, ...]
    covariance: np.ndarray


class End(NamedTuple):
    """Optimum for given half-cycle counts.

    Its misfit is the sum of squares in units of the noise variance; its coordinates have shape (p,).
    """

    half_cycles: tuple[int, ...]
    misfit: float
    y: np.ndarray


class NoiseWeighted(NamedTuple):
    """A solved fit, weighted by the noise of its record.

    Attributes:
        problem: the problem, with samples weighted by timing jitter if it is significant.
        solution: the final fit; its quadratic model and normal matrix include the noise weights.
        variance: factor from the inverse of the quadratic model to the covariance.
        scatter: the same for white noise of the stated level, or of the level of the residuals if stated levels are
            relative; `white`: standard errors of the coordinates with it.
        noises: the noise of each run.
        unsure: covariance to add for the uncertain noise model and the uncertain number of half-cycles; `others`: the
            other numbers.
        went_on: True if the fit continued beyond least squares.
        gain: change of -2 log(likelihood) by the noise model; `numbers`: its number of parameters.
        plain: True if the residuals have proven that the model describes the record, and that its noise is white.
    """

    problem: Problem
    solution: Solution
    variance: float
    scatter: float
    white: np.ndarray
    noises: tuple[Noise, ...]
    unsure: np.ndarray
    others: tuple[AlternativeCount, ...] = ()
    went_on: bool = False
    gain: float = 0.0
    numbers: int = 0
    plain: bool = False


def weigh_by_noise(problem: Problem, solution: Solution, absolute: bool) -> NoiseWeighted:
    """Return the least-squares fit, continued if its noise is not white.

    Args:
        problem: the problem.
        solution: its least-squares solution.
        absolute: if True, the stated noise level is used, unless the residuals contradict it.
    """
    ols = _ols(problem, solution, absolute)
    if not solution.converged or (problem.made and problem.noise == "white"):
        # A record made from the model with white noise needs no test.
        return ols
    rows = rows_of(problem, solution.evaluation)
    quiet = _at_level_of_residuals(problem, solution, rows)
    if quiet is not None:
        return weigh_by_noise(*quiet, absolute)
    if problem.noise == "white":
        return ols
    # Residuals from an omitted force grow with velocity too, so a large misfit excludes jitter.
    small = _largest_ratio(problem, rows, absolute) <= thresholds.DESCRIBED
    jittered = fit_timing_jitter(problem, solution, rows) if small and problem.noise in ("auto", "jitter") else None
    if jittered is None:
        return _with_noise_models(ols, rows, absolute)
    rows = rows_of(jittered.problem, jittered.solution.evaluation)
    gls = _with_noise_models(_ols(jittered.problem, jittered.solution, absolute), rows, absolute)
    pairs = zip(gls.noises, jittered.jitters, strict=True)
    return gls._replace(
        white=ols.white,
        noises=tuple(noise if jitter is None else noise._replace(jitter=jitter.time) for noise, jitter in pairs),
        went_on=True,
        gain=gls.gain + jittered.gain,
        numbers=gls.numbers + 2 * sum(jitter is not None for jitter in jittered.jitters),
    )


def _at_level_of_residuals(
    problem: Problem, solution: Solution, rows: Sequence[Rows]
) -> tuple[Problem, Solution] | None:
    """Return the fit with its noise reduced to that of the residuals.

    Neighbouring samples show the noise only if the motion between them is smooth. With few samples per half-cycle the
    estimate is too large. Return None if no estimate is far too large.
    """
    windows, freedom = [], (problem.dof + solution.shape.step.size) / problem.dof
    for window, row in zip(problem.windows, rows, strict=True):
        variance = row.level * freedom
        # The error of the computed motion is no noise.
        measured = window.sigma_source == ESTIMATED and window.stated >= noise_level(window)
        if measured and 0 < variance < 1 / thresholds.EXCESS:
            share = float(np.sqrt(variance))
            segmentation = dataclasses.replace(window.segmentation, noise=share * window.segmentation.noise)
            window = dataclasses.replace(
                window, sigma=share * window.sigma, sigma_source=OF_RESIDUALS, segmentation=segmentation
            )
        windows.append(window)
    if all(after is before for after, before in zip(windows, problem.windows, strict=True)):
        return None
    problem = with_windows(problem, tuple(windows))
    return problem, solve(problem, solution.y)


def _largest_ratio(problem: Problem, rows: Sequence[Rows], absolute: bool) -> float:
    """Return the largest residual-to-noise ratio over all runs."""
    sizes = [2 * [float(np.sqrt(row.level))] for row in rows]
    return worst(problem, sizes, [0.0] * len(rows), not absolute).ratio


def _with_noise_models(ols: NoiseWeighted, first: Sequence[Rows], absolute: bool) -> NoiseWeighted:
    """Return the fit continued with noise models.

    Args:
        ols: its least squares.
        first: their rows.
        absolute: as in `weigh_by_noise`.
    """
    problem, solution = ols.problem, ols.solution
    none = np.zeros(problem.residual.n_parameters)
    at, rows, seen, ambiguity = solution, first, [], none
    # A drift far above the noise causes steps so long that the motion is nonlinear within them; the next step corrects
    # the rest. A misfit that no noise explains decreases by less than a factor ten.
    on_the_way = max(_largest_ratio(problem, first, absolute) / thresholds.DESCRIBED, thresholds.DESCRIBED)
    for number in range(_ROUNDS):
        if number < _LOOKS:
            seen = colours_of(problem, at, rows, absolute)
        else:
            seen = [Seen(row, colour) for row, (_, colour) in zip(rows, seen, strict=True)]
        if not at.evaluation.residual.size and (seen or any(map(rounded, problem.windows))):
            # In a batch the per-sample residuals are not kept.
            at = _reevaluate(problem, at, none)
            rows = rows_of(problem, at.evaluation)
            continue
        if not seen:
            return ols
        least = least_squares(problem, at, weighed_rows(seen))
        ended = at._replace(shape=least[0])
        arrived = ended.shape.distance <= _NEAR
        if not misfit_of(problem, seen, absolute) <= (thresholds.DESCRIBED if arrived else on_the_way):
            return _inflate_for_misfit(ols, first)
        if arrived:
            return _under_colour(ols, at, seen, least, ambiguity, absolute)
        if number == _LOOKS - 1:
            ambiguity = ended.shape.step
        at = _reevaluate(problem, at, ended.shape.step)
        if not np.isfinite(at.evaluation.chi2):
            break
        rows = rows_of(problem, at.evaluation, seen)
        # After a step out of phase with the record, the next ones diverge to huge stiffnesses.
        if any(map(_out_of_phase, problem.windows, rows, first)):
            break
    return _inflate_for_misfit(ols, first)


def _out_of_phase(window: Window, row: Rows, first: Rows) -> bool:
    """Return True if a motion is out of phase with its record.

    Its distance then exceeds half the amplitude, and that of the least-squares fit (`first`).
    """
    # With a robust loss a row of outliers has almost no weight.
    farthest, before = (np.max(np.abs(each.series.residual)) / np.max(each.series.unit) for each in (row, first))
    return bool(farthest > max(IN_PHASE * window.segmentation.amplitude, before))


def _under_colour(
    ols: NoiseWeighted,
    at: Solution,
    seen: Sequence[Seen],
    least: tuple[Quadratic, np.ndarray, np.ndarray],
    ambiguity: np.ndarray,
    absolute: bool,
) -> NoiseWeighted:
    """Return the converged fit under the noise models.

    Args:
        ols: its least squares.
        at: the converged solution.
        seen: the noise models.
        least: quadratic model, gradient and normal matrix with them.
        ambiguity: difference between the estimates under two equally likely noise models, shape (p,).
        absolute: as in `weigh_by_noise`.
    """
    problem, (shape, gradient, normal) = ols.problem, least
    likelihoods = [_likelihood(*run, absolute) for run in seen]
    posterior = _count_posterior(problem, at, seen)
    few = small_sample_covariance([(row.series, colour) for row, colour in seen], shape.inverse)
    return ols._replace(
        solution=at._replace(
            evaluation=at.evaluation._replace(gradient=gradient, normal=normal),
            shape=shape,
            numerical_shift=max(ols.solution.numerical_shift, shape.distance),
        ),
        variance=1.0,
        unsure=few + posterior.covariance + np.outer(ambiguity, ambiguity),
        others=posterior.others,
        noises=tuple(_noise(window, *run) for window, run in zip(problem.windows, seen, strict=True)),
        went_on=True,
        gain=sum(gain for gain, _ in likelihoods),
        numbers=sum(numbers for _, numbers in likelihoods),
    )


def _ols(problem: Problem, solution: Solution, absolute: bool) -> NoiseWeighted:
    """Return the fit under white noise, at least of the stated level."""
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
        End(half_cycles(like), at.predicted_chi2 / variance, at.y[: at.shape.step.size] + at.shape.step)
        for like, at in (((problem, solution), *solution.rivals) if solution.rivals else ())
    ]
    posterior = doubt_of(ends, problem.residual.n_parameters)
    white = np.sqrt(np.diag(scatter * solution.shape.inverse + posterior.covariance))
    return NoiseWeighted(problem, solution, variance, scatter, white, noises, posterior.covariance, posterior.others)


def _count_posterior(problem: Problem, at: Solution, seen: Sequence[Seen]) -> CountPosterior:
    """Return the posterior of half-cycle counts under the noise models.

    All counts use the noise models of the selected one.
    """
    ends = []
    # Without alternatives the selected count is certain, whatever its misfit.
    for like, reached in ((problem, at), *at.rivals) if at.rivals else ():
        alternative = under_noise(like, reached, seen)
        step = alternative.shape.step
        ends.append(End(half_cycles(like), alternative.misfit, reached.y[: step.size] + step))
    return doubt_of(ends, problem.residual.n_parameters)


def _inflate_for_misfit(ols: NoiseWeighted, rows: Sequence[Rows]) -> NoiseWeighted:
    """Enlarge the errors of least squares for unexplained residuals.

    Their size and correlation time are those in motion.
    """
    pairs = zip(ols.problem.windows, rows, strict=True)
    moving = [row.series.residual[row.series.t <= window.stopped] for window, row in pairs]
    times = [whiteness(left).correlation_time for left in moving]
    sizes = [float(np.mean(left**2)) for left in moving]
    noises = tuple(
        Noise(excess=float(np.sqrt(row.level)), memory=float(time) * row.samples * row.interval)
        for row, time in zip(rows, times, strict=True)
    )
    variance = max(time * size for time, size in zip(times, sizes, strict=True))
    return ols._replace(variance=max(variance, ols.variance), noises=noises)


def _reevaluate(problem: Problem, at: Solution, step: np.ndarray) -> Solution:
    """Evaluate the fit after a step."""
    p, limits = step.size, problem.limits
    y = np.concatenate([np.clip(at.y[:p] + step, limits.lower, limits.upper), at.y[p:]])
    evaluated = evaluate_at(problem, checking(problem.residual, y), y)
    return at._replace(y=y, evaluation=evaluated.evaluation, derived=evaluated.derived, passes=at.passes + 1)


def _noise(window: Window, row: Rows, colour: Colour) -> Noise:
    """Convert a noise model for the user."""
    t, order = row.series.t, colour.coefficients.size
    largest = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -colour.coefficients]))), initial=0.0))
    walks = largest >= 1 or not colour.has_level
    memory = 0.0 if not order else np.inf if walks else -row.samples * row.interval / np.log(largest)
    return Noise(
        excess=float(np.sqrt(variance_left(row, colour))),
        memory=float(memory),
        rounding=window.gain * window.segmentation.resolution
        if row.series.rounding.size and colour.beside.size
        else 0.0,
        drift=colour.speed(t),
        middle=float(t.mean()),
        lines=tuple(Line(f, *map(float, pair)) for f, pair in zip(colour.lines, colour.waves, strict=True)),
        expected=expected_size(window, row, colour),
        floor=2 * colour.kicks * colour.std**2,
    )


def _likelihood(row: Rows, colour: Colour, absolute: bool) -> tuple[float, int]:
    """Return the change of -2 log(likelihood) by a noise model.

    Also return its number of parameters.
    """
    residual, unit = row.series.residual, 1.0 if absolute else row.level
    squares = float(np.sum(whitened(row.series, colour)[0] ** 2)) + colour.log_determinant
    return squares - float(residual @ residual) / unit - residual.size * np.log(unit), colour.n_parameters


def doubt_of(ends: Sequence[End], parameters: int) -> CountPosterior:
    """Return the posterior of the counts; the first of `ends` is selected."""
    if not ends:
        return CountPosterior((), np.zeros((parameters, parameters)))
    misfits = np.array([end.misfit for end in ends])
    odds = np.exp(-(misfits - misfits.min()) / 2)
    probabilities = odds / odds.sum()
    moves = np.array([end.y - ends[0].y for end in ends])
    others = [AlternativeCount(end.half_cycles, float(p)) for end, p in zip(ends[1:], probabilities[1:], strict=True)]
    return CountPosterior(tuple(others), (moves.T * probabilities) @ moves)
