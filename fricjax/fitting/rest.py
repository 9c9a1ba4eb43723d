"""The final stop: does the fitted law stop the mass where the record says, and what does that tell of static friction?

The number of half-cycles decides where a set-valued law lets the mass rest, and it is taken from the record.
Afterwards the fitted law is asked for its own count. Static friction has no gradient in a Coulomb law; it lies
between the spring forces at the turning points where the mass stopped and those at which it moved on.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..oscillator import Oscillator
from .names import sole_coulomb
from .problem import Problem
from .residual import Residual, motion
from .solve import Solved, solve
from .window import NEVER

_ADEQUATE = 2.0
_STROKE_SHARE = 0.02


class Margin(NamedTuple):
    """Distance of the turning points to another number of half-cycles [m]; negative where the law counts otherwise.

    Attributes:
        one_more: what the spring lacks at the stop to overcome static friction, over the stiffness.
        one_less: its excess at the turning point before, over the stiffness.
    """

    one_more: float
    one_less: float


def _reversals(residual: Residual, y: Array, run: int, forced: bool) -> tuple[np.ndarray, int, Oscillator]:
    """Turning points of one run, stopped as the record says or, unless `forced`, by the rest condition.

    Returns:
        The turning points, the number of half-cycles, and the machine.
    """
    machine, own, data = residual.machine(y), residual.own(y, run), residual.runs[run]
    found = motion(residual.engine, machine, own, data.t, data.half_cycles if forced else None)
    return np.asarray(found.turning_points), int(found.n_half_cycles), machine


def solve_with_rest(problem: Problem) -> tuple[Problem, Solved]:
    """Solve with the record's number of half-cycles, and try others where law or residuals ask for it.

    Another number is tried where the fitted law would stop the mass at another reversal, and where the residuals are so
    large that a wrong number could be the reason: then one more and one less, as long as that makes the fit better.
    """
    solved = solve(problem)
    tried, counts = set(), _counts(problem)
    spent = [solved]
    while candidates := _candidates(problem, solved) - tried - {counts}:
        tried |= {counts, *candidates}
        rivals = [_with_counts(problem, candidate) for candidate in sorted(candidates)]
        results = [solve(rival, solved.y) for rival in rivals]
        spent += results
        better = [i for i, r in enumerate(results) if r.converged and r.chi2 < solved.chi2]
        if not better:
            break
        best = min(better, key=lambda i: results[i].chi2)
        problem, solved, counts = rivals[best], results[best], _counts(rivals[best])
    totals = {name: sum(getattr(s, name) for s in spent) for name in ("iterations", "passes", "stages")}
    return problem, solved._replace(**totals)


def _counts(problem: Problem) -> tuple[int, ...]:
    return tuple(int(run.half_cycles) for run in problem.residual.runs)


def _with_counts(problem: Problem, counts: tuple[int, ...]) -> Problem:
    arrays = [jnp.asarray(count) for count in counts]
    residual = eqx.tree_at(lambda r: [run.half_cycles for run in r.runs], problem.residual, arrays)
    return dataclasses.replace(problem, residual=residual)


def _candidates(problem: Problem, solved: Solved) -> set[tuple[int, ...]]:
    """Other numbers of half-cycles worth a fit."""
    counts = _counts(problem)
    stopping = [run for run, count in enumerate(counts) if count < NEVER]
    if not problem.residual.oscillator.friction.set_valued or not stopping:
        return set()
    found = set()
    if problem.bracketed is None:
        found.add(tuple(_own_count(problem.residual, solved.y, run) for run in range(len(counts))))
    if _far_off(problem, solved):
        steps = [(run, step) for run in stopping for step in (-1, 1) if counts[run] + step > 0]
        found |= {(*counts[:run], counts[run] + step, *counts[run + 1 :]) for run, step in steps}
    return found - {counts}


def _far_off(problem: Problem, solved: Solved) -> bool:
    """Whether the residuals are larger than the noise, and large enough for a missed or added stroke."""
    excess = solved.chi2 / problem.n_used
    sigma = float(np.median(np.concatenate([w.sigma[w.used] for w in problem.windows])))
    stroke = float(problem.residual.machine(solved.y).dead_band)
    return excess > _ADEQUATE and sigma * np.sqrt(excess) > _STROKE_SHARE * stroke


def _own_count(residual: Residual, y: Array, run: int) -> int:
    """Half-cycles until the rest condition holds; the record's count where it ends in motion or the law never stops."""
    recorded = int(residual.runs[run].half_cycles)
    own = int(_reversals(residual, y, run, False)[1])
    return recorded if recorded >= NEVER or own <= 0 else own


def rest_margin(residual: Residual, y: Array, run: int) -> Margin | None:
    """Distance to one half-cycle more or less, None where the record ends in motion or nothing holds the mass."""
    count = int(residual.runs[run].half_cycles)
    if not residual.oscillator.friction.set_valued or count >= NEVER or count < 1:
        return None
    reversals, _, machine = _reversals(residual, y, run, True)
    excess = np.abs(np.asarray(machine.restoring_force(reversals))) - machine.friction.static_force(
        machine.normal_force
    )
    stop, before = (float(excess[n] / machine.stiffness) for n in (count, count - 1))
    return Margin(-stop, np.inf if count == 1 and _starts_moving(residual, y, run) else before)


def _starts_moving(residual: Residual, y: Array, run: int) -> bool:
    """Whether a run starts in mid-stroke, so that the first of its turning points is none."""
    return bool(residual.own(y, run)["v0"] != 0)


def bracket_static(problem: Problem, y: Array) -> tuple[float, float] | None:
    """Interval of a Coulomb law's static coefficient: above every stop and the dynamic value, below every non-stop."""
    if sole_coulomb(problem.residual.oscillator.friction) is None:
        return None
    lower, upper = 0.0, np.inf
    for run, window in enumerate(problem.windows):
        points, _, machine = _reversals(problem.residual, y, run, True)
        pull = np.abs(np.asarray(machine.restoring_force(points))) / float(machine.normal_force)
        count = int(problem.residual.runs[run].half_cycles)
        stopped = count < NEVER
        moved_on = pull[int(_starts_moving(problem.residual, y, run)) : count if stopped else window.strokes]
        upper = min(upper, float(np.min(moved_on, initial=np.inf)))
        dynamic = machine.friction.dynamic_force(machine.normal_force) / machine.normal_force
        lower = max(lower, float(pull[count]) if stopped else 0.0, float(dynamic))
    return lower, upper
