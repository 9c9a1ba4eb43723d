"""Refits of a record with other models.

They use tables of forces, so they compile nothing.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ... import thresholds
from ...data import Record
from ...data.repair import repair, reported_faults
from ...errors import DataError, UsageError
from ...estimation.loss import Squares
from ..noise import Noise
from ..noise_weighting import NoiseWeighted
from ..parameters import Request
from ..problem import Problem, problem_on, windows_of, with_windows
from ..rest import with_counts
from ..solve import Solution, checking, half_cycles, on_all_samples, solution_of, start_coordinates, with_inputs
from ..stages import EVALUATE_ONLY, Iterate, Schedule, solve_on_host
from ..tabulate import Tables
from .criterion import DECIDED, RIVAL, Score, gain, independent_noise, moving_rows, score
from .terms import Term, terms
from .unexplained import rises, unexplained

# A trial starts in phase and needs one stage. Most end within six steps. Tolerance in standard errors.
_SCHEDULE = Schedule(tolerance=np.asarray(0.03), sure=np.asarray(True), steps=np.asarray(25))
# Largest number of terms that are added.
_DEPTH = 3


class Trial(NamedTuple):
    """A refitted model.

    Attributes:
        names: its terms, in the order in which they were added.
        how: arguments that fit it.
        request: request of the fit.
        problem, solution: problem and its optimum.
        gain: gain over the asked model.
        before: root mean square of the residuals of that model in motion, in the unit of the record.
    """

    names: tuple[str, ...]
    how: str
    request: Request
    problem: Problem
    solution: Solution
    gain: float = 0.0
    before: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return dict(zip(self.problem.names, map(float, self.solution.derived.values), strict=True))

    @property
    def size(self) -> float:
        """Largest root mean square of the residuals of a run in motion."""
        parts = zip(self.problem.by_run(self.solution.evaluation.residual), self.problem.windows, strict=True)
        return max(float(np.sqrt(np.mean(np.square(part[w.moving]))) * w.stated) for part, w in parts)

    @property
    def white(self) -> bool:
        """True if the residuals in motion are white."""
        return all(is_white(self.problem, self.solution, run) for run in range(len(self.problem.windows)))


def is_white(problem: Problem, solution: Solution, run: int) -> bool:
    """Return True if the residuals of a run in motion are white.

    Their level must be that of neighbouring samples.

    Averages of samples decide: their variance exceeds that of independent samples if the residuals are slow.
    """
    rows, moving = moving_rows(problem, solution, run)
    residual = rows.series.residual[moving]
    level = independent_noise(problem, run) ** 2
    return bool(np.mean(residual**2) <= level * (1 + thresholds.SURE * np.sqrt(2 / residual.size)))


def alternatives(weighted: NoiseWeighted) -> list[Trial]:
    """Return the preferred model and its rivals.

    The list is empty without trials. White residuals need no trials; models with internal states and robust losses
    have none.
    """
    problem, solution = weighted.problem, weighted.solution
    fast = isinstance(problem.residual.engine, Tables) and isinstance(problem.loss, Squares)
    if weighted.plain or problem.made or problem.request is None or not (fast and solution.converged):
        return []
    if all(is_white(problem, solution, run) for run in range(len(problem.windows))):
        return []
    if not solution.evaluation.residual.size:
        # A batch keeps no residuals of samples.
        again = evaluated(problem, solution.y[: problem.residual.n_parameters])
        solution = solution if again is None else solution._replace(evaluation=again.evaluation)
    return trials(problem, solution, weighted.noises)


def trials(problem: Problem, solution: Solution, noises: Sequence[Noise]) -> list[Trial]:
    """Refit a record with further terms.

    The result is the preferred model and its rivals. It is the asked model if no other one is preferred. A term is
    added to the best model so far, as long as the criterion decides for it and the residuals are not white.

    Args:
        problem: the problem; its engine must be that of tables.
        solution: its least-squares solution.
        noises: noise of each run.
    """
    assert problem.request is not None
    asked = Trial((), "", problem.request, problem, solution)
    asked = best = asked._replace(before=asked.size)
    base, rivals = score(problem, solution, noises), list[Trial]()
    # No term makes an amplitude rise again.
    irregular = any(rises(window) for window in problem.windows)
    for depth in range(_DEPTH):
        tried = [] if irregular else list(_with_terms(best, noises, base))
        tried += _with_repairs(asked, noises, base) if depth == 0 else ()
        tried = sorted((trial for trial in tried if trial.size < best.size), key=lambda trial: -trial.gain)
        if not tried or not tried[0].gain > best.gain + DECIDED:
            break
        # Of rivals the one with the fewest parameters is preferred.
        rivals = [trial for trial in tried if trial.gain > tried[0].gain - RIVAL]
        best = min(rivals, key=lambda trial: len(trial.problem.parameters))
        rivals = [trial for trial in rivals if trial is not best]
        if best.white or best.request is problem.request:
            # A repaired record needs a fit with trials.
            break
    return [trial._replace(how=_arguments(problem.request, trial)) for trial in (best, *rivals)]


def _arguments(asked: Request, trial: Trial) -> str:
    """Return the arguments that fit all terms of a trial."""
    ours, theirs = asked.oscillator, trial.request.oscillator
    parts = []
    if type(ours.restoring) is not type(theirs.restoring):
        parts.append(f"restoring={type(theirs.restoring).__name__}({'0.0' if theirs.restoring.coefficients else ''})")
    if type(ours.friction) is not type(theirs.friction):
        parts.append(f"friction={type(theirs.friction).__name__}(...)")
    if asked.free != trial.request.free:
        parts.append(f"free={list(trial.request.free)}")
    return f"with {' and '.join(parts)}" if parts else trial.how


def _with_terms(best: Trial, noises: Sequence[Noise], base: Score) -> Iterator[Trial]:
    """Yield the model with each further term, the most promising ones first."""
    possible = list(terms(best.request, best.problem.windows[0], best.values))
    gross = unexplained(best.problem, best.solution, noises).share > thresholds.UNEXPLAINED
    # A model that misses its record may have led to another number of half-cycles than that of the record.
    gross = gross or half_cycles(best.problem) != tuple(window.half_cycles for window in best.problem.windows)
    promising = _by_start_values(best, possible, noises) if gross else _by_response(best, possible, noises)
    for _, term, starts in sorted(promising, key=lambda each: each[0]):
        trial = None
        for problem, y in starts:
            other = _trial(best, term, problem, y, noises, base)
            trial = max(filter(None, (trial, other)), key=lambda each: each.gain, default=None)
            if trial is not None and trial.gain > best.gain + DECIDED and trial.solution.converged:
                break
        if trial is not None:
            yield trial
            if trial.gain > best.gain + DECIDED and trial.white:
                return


def _trial(
    best: Trial, term: Term, problem: Problem, y: np.ndarray, noises: Sequence[Noise], base: Score
) -> Trial | None:
    """Return the trial of a term, None without a sensible optimum.

    It starts from coordinates `y`.
    """
    solution = solved(problem, y)
    if solution is None or problem.request is None:
        return None
    trial = best._replace(how=term.how, request=problem.request, problem=problem)
    trial = trial._replace(solution=solution, gain=gain(base, score(problem, solution, noises)))
    name = term.name(trial.values)
    return trial._replace(names=(*best.names, name)) if name and name not in best.names else None


type _Start = tuple[float, Term, Sequence[tuple[Problem, np.ndarray]]]


def _by_response(best: Trial, possible: Sequence[Term], noises: Sequence[Noise]) -> Iterator[_Start]:
    """Yield promising terms, each with a rank and starts.

    The derivatives of the motion predict the gain of each term to first order. If the residuals are small, a term
    without a predicted gain needs no trial. One model with all further forces is evaluated for all of them.
    """
    base = score(best.problem, best.solution, noises)
    forces = [term for term in possible if term.neutral and not term.other]
    together, values = best.request, best.values
    for term in forces:
        together, values = term.change(together), {**term.neutral, **values}
    joint = _evaluated(best, together, values) if forces else None
    for term in possible:
        values = {**term.neutral, **best.values}
        at = joint if term in forces else _evaluated(best, term.change(best.request), values)
        names = [*best.problem.names, *term.neutral]
        predicted = RIVAL if at is None or not term.neutral else gain(base, score(*at, noises, names))
        if predicted >= RIVAL:
            yield -predicted, term, _near(best, term)


def _near(best: Trial, term: Term) -> list[tuple[Problem, np.ndarray]]:
    """Return starts of a term from the fitted values of a model."""
    problem, values = _problem(best, term.change(best.request)), {**term.neutral, **best.values}
    starts = [(problem, _coordinates(problem, values))]
    return [*starts, (problem, _coordinates(problem, {**values, **term.other}))] if term.other else starts


def _evaluated(best: Trial, request: Request, values: Mapping[str, float]) -> tuple[Problem, Solution] | None:
    """Return the problem of a request, evaluated at values by name."""
    problem = _problem(best, request)
    at = evaluated(problem, _coordinates(problem, values))
    return None if at is None else (problem, at)


def _by_start_values(best: Trial, possible: Sequence[Term], noises: Sequence[Noise]) -> Iterator[_Start]:
    """Yield all terms likewise, for a model far from its record.

    A trial starts from the start values and half-cycles of the record, or from the fitted values of the model. The
    criterion at the better one is the rank.
    """
    base = score(best.problem, best.solution, noises)
    for term in possible:
        near = _near(best, term)
        far = with_counts(near[0][0], tuple(window.half_cycles for window in best.problem.windows))
        starts = [(far, start_coordinates(far)), *near]
        at = [evaluated(*start) for start in starts]
        ranks = [
            np.inf if s is None else -gain(base, score(p, s, noises)) for (p, _), s in zip(starts, at, strict=True)
        ]
        order = np.argsort(ranks, kind="stable")
        yield ranks[order[0]], term, [starts[place] for place in order]


def _problem(best: Trial, request: Request) -> Problem:
    """Return the problem of a request for the samples of a trial."""
    # A rig describes the asked machine, and its inputs do not matter here.
    request = dataclasses.replace(request, rig=None)
    return with_counts(problem_on(best.problem.windows, request), half_cycles(best.problem))


def _with_repairs(asked: Trial, noises: Sequence[Noise], base: Score) -> Iterator[Trial]:
    """Yield fits of the repaired record, and without its outliers."""
    window, *others = asked.problem.windows
    if others:
        return
    record = Record(window.trace, {"quantity": window.quantity})
    repaired = [
        (f"repair of its {word}", f"with repair='{word}'", _on_record(asked, repair(record, word)))
        for word in reported_faults(record)
    ]
    repaired.append(("less weight for outliers", "with loss='huber'", _without_outliers(asked)))
    for name, how, trial in repaired:
        if trial is not None:
            reached = gain(base, score(trial.problem, trial.solution, noises))
            yield trial._replace(names=(name,), how=how, gain=reached)


def _without_outliers(asked: Trial) -> Trial | None:
    """Return the fit without a few outliers, if any.

    The largest 2 % of the residuals in motion hold 90 % of the sum of squares; for a sinusoid they hold 4 %
    (convention).
    """
    problem, window = asked.problem, asked.problem.windows[0]
    squares = np.square(problem.by_run(asked.solution.evaluation.residual)[0]) * window.moving
    few = np.argsort(-squares)[: np.count_nonzero(window.moving) // 50]
    if not np.sum(squares[few]) > 0.9 * np.sum(squares):
        return None
    kept = np.ones(squares.size, bool)
    kept[few] = False
    windows = (dataclasses.replace(window, used=window.used & kept, moving=window.moving & kept),)
    problem = with_windows(problem, windows)
    solution = solved(problem, asked.solution.y[: problem.residual.n_parameters])
    return None if solution is None else asked._replace(problem=problem, solution=solution)


def _on_record(asked: Trial, record: Record) -> Trial | None:
    """Return the asked model fitted to another version of the record."""
    try:
        problem = problem_on(windows_of((record,), asked.request), asked.request)
    except (DataError, UsageError):
        return None
    starts = _coordinates(problem, asked.values), start_coordinates(problem)
    solutions = [solution for y in starts if (solution := solved(problem, y)) is not None]
    solution = min(solutions, key=lambda each: each.chi2, default=None)
    return None if solution is None else asked._replace(problem=problem, solution=solution)


def _coordinates(problem: Problem, values: Mapping[str, float]) -> np.ndarray:
    """Return the coordinates of values by name.

    Others take their start values.
    """
    at = np.array([values.get(parameter.name, parameter.start) for parameter in problem.parameters])
    return np.clip(problem.residual.space.coordinates(at), problem.limits.lower, problem.limits.upper)


def solved(problem: Problem, y: np.ndarray) -> Solution | None:
    """Return the optimum from coordinates `y`, None if the tables reach none."""
    at = solve_on_host(problem.condensed, problem.stage_weights, problem.limits, problem.loss, y, _SCHEDULE)
    if not (np.isfinite(at.evaluation.cost) and np.all(np.isfinite(at.y))):
        return None
    return evaluated(problem, at.y, at)


def evaluated(problem: Problem, y: np.ndarray, at: Iterate | None = None) -> Solution | None:
    """Evaluate all samples at coordinates `y`, None if not finite."""
    full = with_inputs(problem.residual, y)
    member = on_all_samples(problem, checking(problem.residual, full), full, EVALUATE_ONLY)
    end = solve_on_host(member.residual, member.stage_weights, member.limits, problem.loss, full, EVALUATE_ONLY)
    if not np.all(np.isfinite(end.evaluation.chi2)):
        return None
    solution = solution_of(problem, end._replace(y=y) if at is None else at, end)
    return solution if np.isfinite(solution.chi2) else None
