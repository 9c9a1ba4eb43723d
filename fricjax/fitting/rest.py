"""The final stop: does the fitted law stop the mass where the record says, and what does that tell of static friction?

The number of half-cycles decides where a set-valued law lets the mass rest, and it is taken from the record.
Afterwards the fitted law is asked for its own count. Static friction has no gradient in a Coulomb law; it lies
between the spring forces at the turning points where the mass stopped and those at which it moved on.
"""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.covariance import quadratic
from .names import sole_coulomb
from .noise import whiteness
from .problem import Problem, with_rests
from .residual import motion
from .solve import Rival, Solution, checking, evaluate_at, half_cycles, solve
from .window import NEVER, Window, equilibrium, extremes

# Part of the dead band from which residuals are large enough for a missed or added half-cycle [1]. Convention: it moves
# the rest by a good part of a dead band, of which the mean over all samples keeps some hundredths.
_HALF_CYCLE_SHARE = 0.02
# Friction takes two dead bands in each half-cycle, four in two, and holds the mass within one times the ratio of static
# to dynamic friction: provided for are ratios up to eight.
_STICKS = 2.0


class Margin(NamedTuple):
    """Distance of the turning points to another number of half-cycles [m]; negative where the law counts otherwise.

    Attributes:
        one_more: what the spring lacks at the stop to overcome static friction, over the stiffness.
        one_less: its excess at the turning point before, over the stiffness.
    """

    one_more: float
    one_less: float


CONTRADICTED = "differs from stop to stop"


class Bracket(NamedTuple):
    """Where the static coefficient of a Coulomb law lies.

    Attributes:
        lower, upper: ends of its interval.
        contradicted: whether the mass stopped or slid at the upper end and moved on at the lower one, by more than the
            noise: then no one coefficient fits, and static friction takes values all over the interval.

    Examples:
        >>> bracket = Bracket(lower=0.05, upper=0.08, contradicted=False)
        >>> bracket.lower <= 0.06 <= bracket.upper
        True
    """

    lower: float
    upper: float
    contradicted: bool


def solve_with_rest(problem: Problem, y: np.ndarray | None = None) -> tuple[Problem, Solution]:
    """Solve with the record's number of half-cycles, and try others where law or residuals ask for it.

    Another number is tried where the record leaves it open, where the fitted law would stop the mass at another
    reversal, and where the residuals are so large that a wrong number could be the reason: then one more and one less,
    as long as that makes the fit better. The optimum of a number is foreseen from the one at hand, by a look at the
    record with it: chi^2 there and its slopes tell where it leads. The most promising is fitted first, and one that
    does not lead further is not fitted at all.

    Where residuals are so large, rounding is the least of all errors, and the rest follows from all of its samples;
    these go again when another number has made the residuals small.

    Args:
        problem: the problem.
        y: coordinates to start from; None for the start values.
    """
    rounded, solution = problem, solve(problem, y)
    spent = [solution]
    amiss = far_off(problem, solution) and any(window.repeated.any() for window in problem.windows)
    if amiss:
        problem = with_rests(problem)
        solution = solve(problem, solution.y)
        spent.append(solution)
    tried, seen = {half_cycles(problem)}, dict[tuple[int, ...], Rival]()
    while candidates := _candidates(problem, solution) - tried:
        seen = {counts: _rival(problem, solution, counts) for counts in candidates}
        for counts, rival in sorted(seen.items(), key=lambda each: each[1].solution.foreseen):
            tried.add(counts)
            if rival.solution.foreseen >= solution.chi2:
                continue
            # From where the first fit started: a wrong number has led the one at hand astray.
            result = solve(rival.problem, y)
            spent.append(result)
            if result.converged and _is_better(problem, rival.problem, solution, result):
                problem, solution, seen = rival.problem, result, {}
                break
        else:
            break
    if amiss and not far_off(problem, solution):
        problem = with_counts(rounded, half_cycles(problem))
        solution, seen = solve(problem, solution.y), {}
        spent.append(solution)
    totals = {name: sum(getattr(s, name) for s in spent) for name in ("iterations", "passes", "stages")}
    return problem, solution._replace(**totals, rivals=_rivals(problem, solution, seen))


def _rivals(problem: Problem, solution: Solution, seen: Mapping[tuple[int, ...], Rival]) -> tuple[Rival, ...]:
    """The other numbers of half-cycles that the record leaves open, with which it is described about as well.

    Some may have been `seen` from this solved.
    """
    if not (solution.converged and problem.residual.oscillator.friction.set_valued):
        return ()
    rivals = [seen.get(counts) or _rival(problem, solution, counts) for counts in _open(problem)]
    reach = solution.chi2 + _by_chance(problem, solution) if rivals else 0.0
    return tuple(rival for rival in rivals if rival.solution.foreseen < reach)


def _rival(problem: Problem, solution: Solution, counts: tuple[int, ...]) -> Rival:
    """A solution as the record sees it with other numbers of half-cycles, from which a step leads to the optimum."""
    rival = with_counts(problem, counts)
    looked = evaluate_at(rival, checking(rival.residual, solution.y), solution.y)
    evaluation, at_bound = looked.evaluation, solution.shape.at_bound
    shape = quadratic(
        evaluation.gradient[: at_bound.size], evaluation.normal[: at_bound.size, : at_bound.size], at_bound
    )
    return Rival(rival, solution._replace(evaluation=evaluation, derived=looked.derived, shape=shape))


def _is_better(problem: Problem, rival: Problem, solution: Solution, other: Solution) -> bool:
    """Whether another number of half-cycles describes the record better, against the record's own word if need be.

    Where the record leaves that number open the smaller chi^2 decides; where it is sure, the gain must exceed what
    noise as correlated as the residuals, and the drift that the rest shows, could make of it.
    """
    gain = solution.chi2 - other.chi2
    pairs = zip(problem.windows, half_cycles(problem), half_cycles(rival), strict=True)
    if all(b == a or b - a in window.segmentation.open for window, a, b in pairs):
        return gain > 0
    return gain > _by_chance(rival, other)


def _by_chance(problem: Problem, solution: Solution) -> float:
    """How far apart noise as correlated as the residuals, and the drift that the rest shows, may put two chi^2."""
    correlated = max(whiteness(part).correlation_time for part in problem.by_run(solution.evaluation.residual))
    return thresholds.DECISIVE * correlated * max(map(_unexplained, problem.windows))


def _unexplained(window: Window) -> float:
    """Variance of what is in a record beside its motion, in units of that which the samples are weighted with."""
    segmentation, t = window.segmentation, np.asarray(window.trace.t)[window.used]
    drift = 0.0 if "drift" in window.nuisances else segmentation.drift * (t[-1] - t[0]) / np.sqrt(12)
    return float((segmentation.noise**2 + drift**2) / window.stated**2)


def with_counts(problem: Problem, counts: tuple[int, ...]) -> Problem:
    """The problem with other numbers of half-cycles, one for each run."""
    arrays = [np.asarray(count) for count in counts]
    residual, condensed = (each.with_runs(half_cycles=arrays) for each in (problem.residual, problem.condensed))
    return dataclasses.replace(problem, residual=residual, condensed=condensed)


def _candidates(problem: Problem, solution: Solution) -> set[tuple[int, ...]]:
    """Other numbers of half-cycles worth a fit."""
    counts = half_cycles(problem)
    if not problem.residual.oscillator.friction.set_valued:
        return set()
    stopping = [run for run, count in enumerate(counts) if count < NEVER]
    candidates = set()
    if stopping and problem.bracketed is None:
        candidates.add(tuple(_half_cycles_of_law(problem, solution, run) for run in range(len(counts))))
    others: list[tuple[int, int]] = []
    if far_off(problem, solution):
        others += [(run, counts[run] + step) for run in stopping for step in (-1, 1) if counts[run] + step > 0]
    others += _late_stops(problem, solution)
    candidates |= {(*counts[:run], count, *counts[run + 1 :]) for run, count in others}
    return candidates.union(_open(problem)) - {counts}


def _open(problem: Problem) -> list[tuple[int, ...]]:
    """The other numbers of half-cycles that the record itself leaves possible, that of one run at a time."""
    counts, others_open = half_cycles(problem), []
    for run, window in enumerate(problem.windows):
        others = [counts[run] + step for step in window.segmentation.open] if counts[run] < NEVER else []
        others_open += [(*counts[:run], count, *counts[run + 1 :]) for count in others if count > 0]
    return others_open


def miscounted(problem: Problem, solution: Solution) -> bool:
    """Whether the residuals are so large that a wrong number of half-cycles could be the reason."""
    return far_off(problem, solution) or bool(_late_stops(problem, solution))


def _late_stops(problem: Problem, solution: Solution) -> list[tuple[int, int]]:
    """Runs that seem to move to the end of the record but may have stopped just before it, with their half-cycles."""
    if solution.chi2 / problem.n_used <= thresholds.EXCESS:
        return []
    runs = zip(problem.windows, half_cycles(problem), strict=True)
    moving = [(run, window) for run, (window, count) in enumerate(runs) if count >= NEVER]
    return [(run, window.completed + 1) for run, window in moving if _may_have_stopped(window)]


def _may_have_stopped(window: Window) -> bool:
    """Whether the last swings are so small against what friction takes from each that the next may have been none."""
    swings = np.abs(extremes(window.segmentation)[1] - equilibrium(window.segmentation))
    # Over two half-cycles, which an error of the equilibrium leaves as they are.
    return swings.size < 3 or bool(swings[-1] < _STICKS * (swings[-3] - swings[-1]))


def far_off(problem: Problem, solution: Solution) -> bool:
    """Whether the residuals are larger than the noise, and large enough for a missed or added half-cycle."""
    excess = solution.chi2 / problem.n_used
    if excess <= thresholds.EXCESS:
        return False
    sigma = float(np.median(np.concatenate([w.sigma[w.used] for w in problem.windows])))
    return sigma * np.sqrt(excess) > _HALF_CYCLE_SHARE * float(solution.derived.machine.dead_band)


def stops_within(problem: Problem, solution: Solution, run: int) -> int | None:
    """The half-cycle after which the law stops a run, None where it goes on behind the last one of the record.

    The rest condition at the turning points that the solution has anyway. A run that the law does not even let begin,
    or that ends in motion, has the number of its record.
    """
    recorded, machine = int(problem.residual.runs[run].half_cycles), solution.derived.machine
    law, load, pulls = machine.friction, machine.normal_force, solution.evaluation.pulls[run]
    begins = _starts_moving(problem, run) or not pulls[0] <= float(law.breakaway_force(load))
    if recorded >= NEVER or not begins:
        return recorded
    sticking = np.flatnonzero(pulls[1 : recorded + 1] <= float(law.static_force(load)))
    return 1 + int(sticking[0]) if sticking.size else None


def _half_cycles_of_law(problem: Problem, solution: Solution, run: int) -> int:
    """Half-cycles until the rest condition holds; the record's count where it ends in motion or the law never stops."""
    within = stops_within(problem, solution, run)
    if within is not None:
        return within
    residual = problem.residual
    at = residual.run_parameters(solution.derived.values, run)
    count = int(motion(residual.engine, solution.derived.machine, at, np.zeros(1), None).n_half_cycles)
    return int(residual.runs[run].half_cycles) if count <= 0 else count


def rest_margin(problem: Problem, solution: Solution, run: int) -> Margin | None:
    """Distance to one half-cycle more or less, None where the record ends in motion or nothing holds the mass."""
    count, machine = int(problem.residual.runs[run].half_cycles), solution.derived.machine
    if not machine.friction.set_valued or count >= NEVER or count < 1:
        return None
    excess = solution.evaluation.pulls[run] - float(machine.friction.static_force(machine.normal_force))
    stop, before = (float(excess[n] / machine.stiffness) for n in (count, count - 1))
    return Margin(-stop, np.inf if count == 1 and _starts_moving(problem, run) else before)


def excess_at_reversals(problem: Problem, solution: Solution, run: int) -> float | None:
    """Least excess of the spring over static friction where a run that ends in motion moved on, over the stiffness [m].

    Negative where the law would stop the mass inside the record; None where the record shows the stop, where nothing
    holds the mass, or where the static coefficient is read off these very reversals.
    """
    machine, ends_in_motion = solution.derived.machine, int(problem.residual.runs[run].half_cycles) >= NEVER
    if not (machine.friction.set_valued and ends_in_motion and problem.bracketed is None):
        return None
    moved_on = solution.evaluation.pulls[run][int(_starts_moving(problem, run)) : problem.windows[run].completed + 1]
    static = float(machine.friction.static_force(machine.normal_force))
    return float((np.min(moved_on, initial=np.inf) - static) / machine.stiffness)


def _starts_moving(problem: Problem, run: int) -> bool:
    """Whether a run starts within a half-cycle, so that the first of its turning points is none."""
    return "v0" in problem.windows[run].nuisances or bool(problem.residual.runs[run].fixed["v0"] != 0)


def bracket_static(problem: Problem, solution: Solution) -> Bracket | None:
    """Interval of a Coulomb law's static coefficient: above every stop and the dynamic value, below every non-stop."""
    machine = solution.derived.machine
    if sole_coulomb(machine.friction) is None:
        return None
    load = float(machine.normal_force)
    lower, upper = float(machine.friction.dynamic_force(machine.normal_force)) / load, np.inf
    for run, window in enumerate(problem.windows):
        pull = solution.evaluation.pulls[run] / load
        count = int(problem.residual.runs[run].half_cycles)
        stopped = count < NEVER
        moved_on = pull[int(_starts_moving(problem, run)) : count if stopped else window.completed]
        upper = min(upper, float(np.min(moved_on, initial=np.inf)))
        lower = max(lower, float(pull[count]) if stopped else 0.0)
    sigma = max(window.stated for window in problem.windows)
    contradicted = lower - upper > thresholds.SUSPECTED * sigma * float(machine.stiffness) / load
    return Bracket(min(lower, upper), max(lower, upper), contradicted)
