"""The final stop: number of half-cycles, and bracket of static friction.

The number of half-cycles determines the place where a set-valued law lets the mass rest. It is taken from the record,
and then compared with the number that the fitted law predicts. Static friction has no gradient in a Coulomb law. It
lies between the spring forces at the turning points where the mass stopped and those where it moved on.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..estimation.covariance import quadratic
from .names import sole_coulomb
from .noise import whiteness
from .problem import Problem, with_rests
from .residual import motion, power
from .solve import Rival, Solution, checking, evaluate_at, half_cycles, solve
from .window import NEVER, Window, equilibrium, extremes

# Smallest residuals, relative to the dead band, that a missed or added half-cycle could cause. Convention: it shifts
# the rest by a large part of a dead band, and a few hundredths of that remain in the mean over all samples.
_HALF_CYCLE_SHARE = 0.02
# The amplitude decreases by two dead bands per half-cycle, four in two, and the mass rests within one dead band times
# the ratio of static to dynamic friction. The factor allows for ratios up to eight.
_STICKS = 2.0


class Margin(NamedTuple):
    """Distance of the turning points to another number of half-cycles [m].

    It is negative if the law predicts another number.

    Attributes:
        one_more: deflection missing at the stop to overcome static friction.
        one_less: deflection in excess of static friction at the turning point before.
    """

    one_more: float
    one_less: float


CONTRADICTED = "differs from stop to stop"


class Bracket(NamedTuple):
    """Interval of the static coefficient of a Coulomb law.

    Attributes:
        lower, upper: ends of its interval.
        contradicted: True if no single coefficient agrees with all stops within the noise: the mass stopped or slid at
            the upper end and moved on at the lower one. Static friction then varies over the interval.

    Examples:
        >>> bracket = Bracket(lower=0.05, upper=0.08, contradicted=False)
        >>> bracket.lower <= 0.06 <= bracket.upper
        True
    """

    lower: float
    upper: float
    contradicted: bool


def solve_with_rest(problem: Problem, y: np.ndarray | None = None) -> tuple[Problem, Solution]:
    """Solve with the record's number of half-cycles, and try others if needed.

    Another number is tried if the record leaves it uncertain, if the fitted law would stop the mass at another
    reversal, or if the residuals are so large that a wrong number could be the cause. In the last case one more and one
    less are tried, as long as the fit improves. The chi^2 at the optimum of another number is predicted from one
    evaluation of the current solution with that number. The most promising number is fitted first; a number without a
    predicted improvement is not fitted.

    With such large residuals rounding is negligible, so all samples of the rest are used. If another number makes the
    residuals small, the repeated samples are dropped again.

    Args:
        problem: the problem.
        y: initial coordinates; None for the start values.
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
        for counts, rival in sorted(seen.items(), key=lambda each: each[1].solution.predicted_chi2):
            tried.add(counts)
            if rival.solution.predicted_chi2 >= solution.chi2:
                continue
            # Start from the initial coordinates: a wrong number may have led the current solution astray.
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
    """Return other numbers of half-cycles that describe the record similarly well.

    `seen` contains those that were evaluated from this solution.
    """
    if not (solution.converged and problem.residual.oscillator.friction.set_valued):
        return ()
    rivals = [seen.get(counts) or _rival(problem, solution, counts) for counts in _open(problem)]
    reach = solution.chi2 + _by_chance(problem, solution) if rivals else 0.0
    return tuple(rival for rival in rivals if rival.solution.predicted_chi2 < reach)


def _rival(problem: Problem, solution: Solution, counts: tuple[int, ...]) -> Rival:
    """Evaluate a solution with other numbers of half-cycles.

    A Gauss-Newton step leads from there to the optimum.
    """
    rival = with_counts(problem, counts)
    evaluated = evaluate_at(rival, checking(rival.residual, solution.y), solution.y)
    evaluation, at_bound = evaluated.evaluation, solution.shape.at_bound
    shape = quadratic(
        evaluation.gradient[: at_bound.size], evaluation.normal[: at_bound.size, : at_bound.size], at_bound
    )
    return Rival(rival, solution._replace(evaluation=evaluation, derived=evaluated.derived, shape=shape))


def _is_better(problem: Problem, rival: Problem, solution: Solution, other: Solution) -> bool:
    """Return True if another number of half-cycles describes the record better.

    If the record leaves that number uncertain, the smaller chi^2 decides. If the record is certain, the gain must
    exceed the difference expected by chance.
    """
    gain = solution.chi2 - other.chi2
    pairs = zip(problem.windows, half_cycles(problem), half_cycles(rival), strict=True)
    if all(b == a or b - a in window.segmentation.open for window, a, b in pairs):
        return gain > 0
    return gain > _by_chance(rival, other)


def _by_chance(problem: Problem, solution: Solution) -> float:
    """Return the chi^2 difference expected by chance.

    It depends on the autocorrelation of the residuals and the drift at rest.
    """
    correlated = max(whiteness(part).correlation_time for part in problem.by_run(solution.evaluation.residual))
    return thresholds.DECISIVE * correlated * max(map(_unexplained, problem.windows))


def _unexplained(window: Window) -> float:
    """Return the variance of noise and drift, over the stated variance."""
    segmentation, t = window.segmentation, np.asarray(window.trace.t)[window.used]
    drift = 0.0 if "drift" in window.nuisances else segmentation.drift * (t[-1] - t[0]) / np.sqrt(12)
    return float((segmentation.noise**2 + drift**2) * (window.gain / window.stated) ** 2)


def with_counts(problem: Problem, counts: tuple[int, ...]) -> Problem:
    """Return the problem with other numbers of half-cycles for the runs."""
    arrays = [np.asarray(count) for count in counts]
    residual, condensed = (each.with_runs(half_cycles=arrays) for each in (problem.residual, problem.condensed))
    return dataclasses.replace(problem, residual=residual, condensed=condensed)


def _candidates(problem: Problem, solution: Solution) -> set[tuple[int, ...]]:
    """Return other numbers of half-cycles to try."""
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
    """Return the numbers of half-cycles that the record leaves uncertain.

    Each differs for one run.
    """
    counts, others_open = half_cycles(problem), []
    for run, window in enumerate(problem.windows):
        others = [counts[run] + step for step in window.segmentation.open] if counts[run] < NEVER else []
        others_open += [(*counts[:run], count, *counts[run + 1 :]) for count in others if count > 0]
    return others_open


def miscounted(problem: Problem, solution: Solution) -> bool:
    """Return True if a wrong number of half-cycles could cause the residuals."""
    return far_off(problem, solution) or bool(_late_stops(problem, solution))


def _late_stops(problem: Problem, solution: Solution) -> list[tuple[int, int]]:
    """Return moving runs that may have stopped just before the end.

    Each comes with its number of half-cycles.
    """
    if solution.chi2 / problem.n_used <= thresholds.EXCESS:
        return []
    runs = zip(problem.windows, half_cycles(problem), strict=True)
    moving = [(run, window) for run, (window, count) in enumerate(runs) if count >= NEVER]
    return [(run, window.completed + 1) for run, window in moving if _may_have_stopped(window)]


def _may_have_stopped(window: Window) -> bool:
    """Return True if friction could have stopped the last half-cycle."""
    swings = np.abs(extremes(window.segmentation)[1] - equilibrium(window.segmentation))
    # A difference over two half-cycles does not depend on the equilibrium.
    return swings.size < 3 or bool(swings[-1] < _STICKS * (swings[-3] - swings[-1]))


def far_off(problem: Problem, solution: Solution) -> bool:
    """Return True if a missed or added half-cycle could cause the residuals."""
    excess = solution.chi2 / problem.n_used
    if excess <= thresholds.EXCESS:
        return False
    sigma = float(np.median(np.concatenate([w.sigma[w.used] / w.gain for w in problem.windows])))
    return sigma * np.sqrt(excess) > _HALF_CYCLE_SHARE * float(solution.derived.machine.dead_band)


def stops_within(problem: Problem, solution: Solution, run: int) -> int | None:
    """Return the half-cycle after which the law stops a run, if any.

    The rest condition is evaluated at the turning points of the solution. A run that the law would not let start, or
    that ends in motion, keeps the number of its record. The result is None if the mass moves on after the last
    half-cycle of the record.
    """
    recorded, machine = int(problem.residual.runs[run].half_cycles), solution.derived.machine
    law, load, pulls = machine.friction, machine.normal_force, _pulls(solution, run)
    begins = _starts_moving(problem, run) or not pulls[0] <= float(law.breakaway_force(load))
    if recorded >= NEVER or not begins:
        return recorded
    sticking = np.flatnonzero(pulls[1 : recorded + 1] <= float(law.static_force(load)))
    return 1 + int(sticking[0]) if sticking.size else None


def _half_cycles_of_law(problem: Problem, solution: Solution, run: int) -> int:
    """Return half-cycles until the rest condition holds.

    The number of the record is returned if it ends in motion or the law never stops.
    """
    within = stops_within(problem, solution, run)
    if within is not None:
        return within
    residual = problem.residual
    at = residual.run_parameters(solution.derived.values, run)
    count = int(motion(residual.engine, solution.derived.machine, at, np.zeros(1), None).n_half_cycles)
    return int(residual.runs[run].half_cycles) if count <= 0 else count


def rest_margin(problem: Problem, solution: Solution, run: int) -> Margin | None:
    """Return the distance to one half-cycle more or less [m].

    It is None if the record ends in motion or the law cannot hold the mass.
    """
    count, machine = int(problem.residual.runs[run].half_cycles), solution.derived.machine
    if not machine.friction.set_valued or count >= NEVER or count < 1:
        return None
    excess = _pulls(solution, run) - float(machine.friction.static_force(machine.normal_force))
    stop, before = (float(excess[n] / machine.stiffness) for n in (count, count - 1))
    return Margin(-stop, np.inf if count == 1 and _starts_moving(problem, run) else before)


def excess_at_reversals(problem: Problem, solution: Solution, run: int) -> float | None:
    """Return the least excess deflection over static friction at reversals [m].

    It applies to a run that ends in motion, and is negative if the law would stop the mass inside the record. It is
    None if the record shows the stop, if the law cannot hold the mass, or if the static coefficient is bracketed by
    these reversals.
    """
    machine, ends_in_motion = solution.derived.machine, int(problem.residual.runs[run].half_cycles) >= NEVER
    if not (machine.friction.set_valued and ends_in_motion and problem.bracketed is None):
        return None
    moved_on = _pulls(solution, run)[int(_starts_moving(problem, run)) : problem.windows[run].completed + 1]
    static = float(machine.friction.static_force(machine.normal_force))
    return float((np.min(moved_on, initial=np.inf) - static) / machine.stiffness)


def _pulls(solution: Solution, run: int) -> np.ndarray:
    """Return the spring force at the turning points of a run [N]."""
    machine: Any = solution.derived.machine
    points = np.asarray(solution.evaluation.turning_points[run])
    # JAX compiles operations for each length, so let there be few.
    padded = np.concatenate([points, np.full(power(points.size, 16) - points.size, np.nan)])
    pulls = np.abs(np.asarray(machine.restoring_force(padded))) - np.asarray(machine.hysteresis(padded))
    return pulls[: points.size]


def _starts_moving(problem: Problem, run: int) -> bool:
    """Return True if a run starts in motion, between turning points."""
    return "v0" in problem.windows[run].nuisances or bool(problem.residual.runs[run].fixed["v0"] != 0)


def bracket_static(problem: Problem, solution: Solution) -> Bracket | None:
    """Return the interval of a Coulomb law's static coefficient.

    It lies above all stops and the dynamic value, and below all reversals where the mass moved on.
    """
    machine = solution.derived.machine
    if sole_coulomb(machine.friction) is None:
        return None
    load = float(machine.normal_force)
    lower, upper = float(machine.friction.dynamic_force(machine.normal_force)) / load, np.inf
    for run, window in enumerate(problem.windows):
        pull = _pulls(solution, run) / load
        count = int(problem.residual.runs[run].half_cycles)
        stopped = count < NEVER
        moved_on = pull[int(_starts_moving(problem, run)) : count if stopped else window.completed]
        upper = min(upper, float(np.min(moved_on, initial=np.inf)))
        lower = max(lower, float(pull[count]) if stopped else 0.0)
    sigma = max(window.stated / window.gain for window in problem.windows)
    contradicted = lower - upper > thresholds.SUSPECTED * sigma * float(machine.stiffness) / load
    return Bracket(min(lower, upper), max(lower, upper), contradicted)
