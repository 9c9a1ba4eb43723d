"""Solving a posed fit: on the condensed record, then checked against a finer solution of all samples.

At the optimum of the condensed record all samples are looked at once, with an engine of clearly smaller error: the
Gauss-Newton step that is left there is what the numerical error of the fit, its condensation included, has moved the
parameters by. Where that is not small against the standard errors, the fit goes on with all samples and the finer
engine. The smooth engine, whose mesh is made for one set of coordinates, gets a new one at the optimum.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..oscillator import Smooth
from .climb import FINE, ROUNDING, Climbed, climb, joined, onwards
from .loss import AbstractLoss, Squares
from .mesh import with_mesh
from .problem import Problem
from .quadratic import Quadratic, quadratic
from .residual import Residual, without_inputs
from .settled import Settled, settle
from .status import AT_BOUND, CONVERGED, OUT_OF_STEPS, STALLED, UNDETERMINED
from .survey import Survey, survey

_ACCURATE = 0.1
_BOUNDLESS = 1e100
ROUGH, NEAR = 100.0, 0.3
# Where a direction is left undetermined, there is no optimum that a finer engine could find.
_OPTIMA = (CONVERGED, AT_BOUND)
# A mesh is made for one set of coordinates, so an optimum may have to be met on a mesh that was made there; until then
# the solver may run out of steps, or stall where the mesh fits no more. It goes on as long as that pays by this factor.
_MESHES, _PAYS = 6, 0.8
_ON_A_MESH = (*_OPTIMA, OUT_OF_STEPS, STALLED)


class Solved(NamedTuple):
    """A solved fit.

    Attributes:
        y: coordinates of the parameters and, all zero, of the inputs of the rig.
        survey: what all samples say there, with the finer engine.
        settled: what the coordinates stand for.
        shape: the quadratic form of chi^2 there.
        numerical_shift: the step that is left there in standard errors as the scatter of the residuals gives them, in
            whatever direction it is the longest: how far numerical errors can have moved any parameter.
        status: what the solver said.
        iterations, passes, stages: steps of Levenberg-Marquardt, passes over the model in all, and stages.
    """

    y: Float[np.ndarray, " coordinates"]
    survey: Survey
    settled: Settled
    shape: Quadratic
    numerical_shift: float
    status: int
    iterations: int
    passes: int
    stages: int

    @property
    def chi2(self) -> float:
        return float(self.survey.chi2)

    @property
    def accurate(self) -> bool:
        """Whether numerical errors are small against the standard errors."""
        return self.numerical_shift <= _ACCURATE

    @property
    def converged(self) -> bool:
        return self.status in (CONVERGED, AT_BOUND, UNDETERMINED)


climb_on = eqx.filter_jit(climb)


climb_onwards = eqx.filter_jit(onwards)


def solve(problem: Problem, y: Any = None) -> Solved:
    """Fit from the start values, or from given coordinates `y`, and check the result."""
    few = problem.condensed
    begin = start_coordinates(problem) if y is None else y[: few.n_parameters]
    meshed, robust = isinstance(few.engine, Smooth), not isinstance(problem.loss, Squares)
    # The first mesh, and the squares of a robust fit, only lead to where it goes on from.
    rough, tolerance = (ROUGH if meshed else 1.0), np.asarray(NEAR if meshed or robust else FINE)
    at = climb_on(with_mesh(few, begin, rough), problem.terrain, problem.limits, begin, tolerance)
    if robust:
        target = with_mesh(without_inputs(problem.residual), at.y)
        at = climb_onwards(target, problem.limits, problem.loss, at)
    elif meshed:
        at = joined(at, climb_on(with_mesh(few, at.y), problem.terrain, problem.limits, at.y, np.asarray(FINE)))
    return _refined(problem, at, *((_MESHES, _ON_A_MESH) if meshed else (1, _OPTIMA)))


def _refined(problem: Problem, at: Climbed, rounds: int, endings: tuple[int, ...]) -> Solved:
    """The fit checked, and while it is not accurate carried on with all samples and the engine of the check.

    Only a fit that ended in one of the ways `endings` is carried on, and one that has stalled as long as that pays.
    """
    residual, solved = problem.residual, _checked(problem, problem.residual, at)
    before = np.inf
    for _ in range(rounds):
        stuck = solved.status == STALLED and not solved.chi2 < _PAYS * before
        if solved.accurate or solved.status not in endings or stuck:
            break
        before = solved.chi2
        residual = finer(problem.residual)
        at = climb_onwards(with_mesh(without_inputs(residual), at.y), problem.limits, problem.loss, at)
        solved = _checked(problem, residual, at)
    return solved


def finer(residual: Residual) -> Residual:
    """The residual with an engine of clearly smaller error."""
    return eqx.tree_at(lambda r: r.engine, residual, residual.engine.finer())


def _checked(problem: Problem, residual: Residual, at: Climbed) -> Solved:
    """Look at all samples at the optimum, with an engine finer than that of `residual`."""
    y = jnp.concatenate([at.y, jnp.zeros(residual.inputs.shape[0])])
    found, settled = look(with_mesh(finer(residual), y), y, problem.loss)
    return judged(problem, *jax.tree.map(np.asarray, (at, found, settled)))


@eqx.filter_jit
def look(residual: Residual, y: Array, loss: AbstractLoss) -> tuple[Survey, Settled]:
    """What all samples say at coordinates `y`, and what these stand for."""
    return survey(residual, y, loss), settle(residual, y)


def judged(problem: Problem, at: Climbed, found: Survey, settled: Settled) -> Solved:
    """The solved fit from where the climb ended and what all samples say there, all of it as numpy arrays."""
    p = at.y.size
    at_bound = (at.y <= problem.limits.lower) | (at.y >= problem.limits.upper)
    shape = quadratic(found.gradient[:p], found.normal[:p, :p], at_bound)
    variance = max(float(found.chi2), _rounding(problem)) / problem.dof
    # A motion that has grown beyond all bounds is as good as not finite, and its squares overflow.
    found = found._replace(residual=np.where(np.abs(found.residual) < _BOUNDLESS, found.residual, np.nan))
    return Solved(
        y=np.concatenate([at.y, np.zeros(found.gradient.size - p)]),
        survey=found,
        settled=settled,
        shape=shape,
        numerical_shift=shape.distance / float(np.sqrt(variance)),
        status=int(at.status),
        iterations=int(at.iterations),
        passes=int(at.iterations) + 2,
        stages=int(at.stages),
    )


def _rounding(problem: Problem) -> float:
    """The chi^2 that rounding alone would leave."""
    runs = problem.residual.runs
    return sum(float(np.square(run.weight).sum() * (ROUNDING * max(run.x.max(), -run.x.min())) ** 2) for run in runs)


def start_coordinates(problem: Problem) -> Any:
    """The start values in coordinates, within the bounds."""
    return np.clip(np.zeros(problem.residual.n_parameters), problem.limits.lower, problem.limits.upper)
