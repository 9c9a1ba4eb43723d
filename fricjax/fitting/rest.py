"""The final stop: does the fitted law stop the mass where the record says, and what does that tell of static friction?

The number of half-cycles decides where a set-valued law lets the mass rest, and it is taken from the record. Afterwards the
fitted law is asked for its own count. Static friction has no gradient in a Coulomb law; it lies between the spring forces
at the turning points where the mass stopped and those at which it moved on.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..friction import Coulomb
from ..oscillator import Motion, Oscillator
from .problem import Problem
from .residual import Residual
from .solve import Solved, solve
from .window import NEVER


class Margin(NamedTuple):
    """How far the turning points lie from another number of half-cycles [m]; negative where the law would count otherwise.

    Attributes:
        one_more: static band minus the final displacement.
        one_less: last amplitude before the stop minus the static band.
    """

    one_more: float
    one_less: float


@eqx.filter_jit
def _motion(residual: Residual, y: Array, run: int, forced: bool) -> tuple[Motion, Oscillator]:
    """Motion of one run, stopped as the record says or, unless `forced`, by the rest condition; and the machine."""
    return residual.motion(y, run, residual.runs[run].half_cycles if forced else None), residual.machine(y)


def solve_with_rest(problem: Problem) -> tuple[Problem, Solved]:
    """Solve, and where the fitted law stops the mass after another number of half-cycles, try that one too."""
    solved = solve(problem)
    if not problem.residual.oscillator.friction.set_valued or problem.bracketed:
        return problem, solved
    own = [_own_count(problem.residual, solved.y, run) for run in range(len(problem.windows))]
    runs = problem.residual.runs
    if all(count == int(run.half_cycles) for count, run in zip(own, runs, strict=True)):
        return problem, solved
    changed = eqx.tree_at(
        lambda r: [run.half_cycles for run in r.runs], problem.residual, [jnp.asarray(count) for count in own]
    )
    other = Problem(**{**problem.__dict__, "residual": changed})
    second = solve(other)
    passes, stages = solved.passes + second.passes, solved.stages + second.stages
    better = second.converged and second.chi2 < solved.chi2
    chosen = second if better else solved
    return (other if better else problem), chosen._replace(passes=passes, stages=stages)


def _own_count(residual: Residual, y: Array, run: int) -> int:
    """Half-cycles until the rest condition holds; the record's count where it ends in motion or the law never stops."""
    recorded = int(residual.runs[run].half_cycles)
    motion, _ = _motion(residual, y, run, False)
    own = int(motion.n_half_cycles)
    return recorded if recorded >= NEVER or own <= 0 else own


def rest_margin(residual: Residual, y: Array, run: int) -> Margin | None:
    """Distance to one half-cycle more or less, None where the record ends in motion or nothing holds the mass."""
    count = int(residual.runs[run].half_cycles)
    if not residual.oscillator.friction.set_valued or count >= NEVER or count < 1:
        return None
    motion, machine = _motion(residual, y, run, True)
    points = np.abs(np.asarray(motion.turning_points))
    band = float(machine.friction.static_force(machine.normal_force) / machine.stiffness)
    return Margin(band - float(points[count]), float(points[count - 1]) - band)


def bracket_static(problem: Problem, y: Array) -> tuple[float, float] | None:
    """Interval of the static coefficient of a Coulomb law: above every stop and the dynamic value, below every non-stop."""
    if not isinstance(problem.residual.oscillator.friction, Coulomb):
        return None
    lower, upper = 0.0, np.inf
    for run, window in enumerate(problem.windows):
        motion, machine = _motion(problem.residual, y, run, True)
        pull = np.abs(np.asarray(machine.restoring_force(motion.turning_points))) / float(machine.normal_force)
        count = min(int(problem.residual.runs[run].half_cycles), window.strokes)
        stopped = int(problem.residual.runs[run].half_cycles) < NEVER
        upper = min(upper, float(np.min(pull[:count], initial=np.inf)))
        lower = max(lower, float(pull[count]) if stopped else 0.0, float(machine.friction.mu))  # pyright: ignore
    return lower, upper
