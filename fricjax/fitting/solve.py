"""Solving a posed fit: on the condensed record, then checked by another solution of all samples.

At the optimum of the condensed record all samples are looked at once, with an engine whose errors are others: the
Gauss-Newton step that is left there is what the numerical error of the fit, its condensation included, has moved the
parameters by. Where that is not small against the standard errors, the fit goes on with all samples and a finer
engine. The smooth engine, whose mesh is made for one set of coordinates, gets a new one at the optimum.

All of that is one program, called with other samples, other meshes and another way to go.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from .. import thresholds
from ..errors import UsageError
from ..estimation.covariance import Quadratic, quadratic
from ..estimation.loss import AbstractLoss, Squares
from ..estimation.status import AT_BOUND, CONVERGED, OUT_OF_STEPS, STALLED, UNDETERMINED
from ..oscillator import Program, waiting
from ..oscillator.engines import AbstractEngine
from .chunks import Member, solve_in_chunks
from .derived import Derived
from .evaluation import Evaluation
from .mesh import likely, with_mesh
from .problem import Problem
from .residual import Residual, without_inputs
from .runs import full_stage
from .stages import CONTINUE, CONTINUE_ROBUST, EVALUATE_ONLY, ROUNDING, Iterate, Schedule, like_iterate, solve_in_stages

_BOUNDLESS = 1e100
# The first mesh, and the squares of a robust fit, only lead to where it goes on from: how much larger errors of that
# mesh may be, and how near its optimum is to be met.
_ROUGH, _NEAR = 100.0, Schedule(tolerance=np.asarray(0.3))
# Where a direction is left undetermined, there is no optimum that a finer engine could find.
_OPTIMA = (CONVERGED, AT_BOUND)
# A mesh is made for one set of coordinates, so an optimum may have to be met on a mesh that was made there; until then
# the solver may run out of steps, or stall where the mesh fits no more. It goes on as long as that pays by this factor.
_MESHES, _PAYS = 6, 0.8
_ON_A_MESH = (*_OPTIMA, OUT_OF_STEPS, STALLED)


class Solution(NamedTuple):
    """A solved fit.

    Attributes:
        y: coordinates of the parameters and, all zero, of the inputs of the rig.
        evaluation: what all samples say there, with the engine of the check.
        derived: what the coordinates stand for.
        shape: the quadratic form of chi^2 there.
        numerical_shift: the step that is left there in standard errors as the scatter of the residuals gives them, in
            whatever direction it is the longest: how far numerical errors can have moved any parameter.
        status: what the solver said.
        iterations, passes, stages: steps of Levenberg-Marquardt, passes over the model in all, and stages.
        rivals: other numbers of half-cycles, with which the record is described about as well.
    """

    y: Float[np.ndarray, " coordinates"]
    evaluation: Evaluation
    derived: Derived
    shape: Quadratic
    numerical_shift: float
    status: int
    iterations: int
    passes: int
    stages: int
    rivals: tuple["Rival", ...] = ()

    @property
    def chi2(self) -> float:
        return float(self.evaluation.chi2)

    @property
    def foreseen(self) -> float:
        """The chi^2 at the end of the step, were the residuals linear; -inf where it is not finite here."""
        ahead = self.chi2 - self.shape.distance**2
        return ahead if np.isfinite(ahead) else -np.inf

    @property
    def accurate(self) -> bool:
        """Whether numerical errors are small against the standard errors."""
        return self.numerical_shift <= thresholds.ACCURATE

    @property
    def converged(self) -> bool:
        return self.status in (CONVERGED, AT_BOUND, UNDETERMINED)


class Rival(NamedTuple):
    """The problem with another number of half-cycles, and what the record says of it where that at hand was solved."""

    problem: Problem
    solution: Solution


def half_cycles(problem: Problem) -> tuple[int, ...]:
    """The number of half-cycles of each run."""
    return tuple(int(run.half_cycles) for run in problem.residual.runs)


staged = Program(solve_in_stages, like_iterate)


def one_by_one(members: Sequence[Member], loss: AbstractLoss) -> list[Iterate]:
    """The iterate of each problem, each by a program of its own."""
    with waiting():
        ends = [staged(m.residual, m.stage_weights, m.limits, loss, m.y, m.schedule) for m in members]
        return jax.tree.map(np.asarray, ends)


# The way of one fit, from top to bottom: `solve` calls `solve_condensed`, which goes in stages to the optimum of few
# samples (`_optima`), and `_refined`, which evaluates all samples there (`_checked`) and goes on while that shifts it.
# Many fits take the same way in `solve_batch`, but for the last step.
def solve(problem: Problem, y: Any = None) -> Solution:
    """Fit from the start values, or from given coordinates `y`, and check the result."""
    at = solve_condensed(problem, start_coordinates(problem) if y is None else y[: problem.condensed.n_parameters])
    meshed = problem.residual.engine.needs_mesh
    return _refined(problem, at, *((_MESHES, _ON_A_MESH) if meshed else (1, _OPTIMA)))


def solve_batch(problems: Sequence[Problem], begins: Sequence[np.ndarray] | None = None) -> list[tuple[Solution, Any]]:
    """Fit problems of one loss in chunks and check the results, for engines that need no mesh.

    No solution goes on to finer engines, and none keeps the residuals of its samples, of which only the typical sizes
    are handed on, over all and in motion. `begins` are the coordinates from which each problem starts, in place of its
    start values.
    """
    if not problems:
        return []
    begins = [start_coordinates(problem) for problem in problems] if begins is None else begins
    run = lambda members, loss: [at for at, _ in solve_in_chunks(members, loss)]
    ends = _optima(problems, begins, run, Schedule())
    targets = [with_inputs(problem.residual, at.y) for problem, at in zip(problems, ends, strict=True)]
    pairs = zip(problems, targets, strict=True)
    members = [on_all_samples(p, checking(p.residual, y), y, EVALUATE_ONLY) for p, y in pairs]
    checked = zip(problems, ends, solve_in_chunks(members, problems[0].loss), strict=True)
    return [(solution_of(problem, at, evaluated), sizes) for problem, at, (evaluated, sizes) in checked]


def solve_condensed(problem: Problem, begin: Any) -> Iterate:
    """The optimum of the condensed record, from coordinates `begin`; of all samples under a robust loss."""
    _compile_beside(problem, begin)
    return _optima([problem], [begin], one_by_one, _NEAR)[0]


def _compile_beside(problem: Problem, begin: Any) -> None:
    """What a first fit waits for: the solver, beside its mesh, and the look with the inputs of a rig, beside both."""
    wanted = []
    if problem.residual.engine.needs_mesh and (expected := likely(problem.condensed, begin)) is not None:
        wanted.append((Member(expected, problem.stage_weights, problem.limits, begin, _NEAR), Squares()))
    if problem.residual.inputs.shape[0] and (expected := likely(problem.residual, begin)) is not None:
        looked = _with_engine(expected, expected.engine.checking())
        member = on_all_samples(problem, looked, with_inputs(looked, begin), EVALUATE_ONLY)
        wanted.append((member, problem.loss))
    for m, loss in wanted:
        args = m.residual, m.stage_weights, m.limits, loss, m.y, m.schedule
        if not staged.is_compiled(*args):
            staged.compile_beside(*args)


def _optima(
    problems: Sequence[Problem], begins: Sequence[Any], run: Callable[..., list[Iterate]], near: Schedule
) -> list[Iterate]:
    """The same of many problems of one engine and loss; a first stage that only leads on comes `near` its optimum."""
    meshed, robust = problems[0].residual.engine.needs_mesh, not isinstance(problems[0].loss, Squares)
    few = [with_mesh(p.condensed, y, _ROUGH) for p, y in zip(problems, begins, strict=True)]
    schedule = near if meshed or robust else Schedule()
    starts = zip(problems, few, begins, strict=True)
    ends = run([Member(r, p.stage_weights, p.limits, y, schedule) for p, r, y in starts], Squares())
    reached = list(zip(problems, few, ends, strict=True))
    if robust:
        full = [with_mesh(without_inputs(p.residual), at.y) for p, _, at in reached]
        pairs = zip(problems, full, ends, strict=True)
        further = run([on_all_samples(p, r, at.y, CONTINUE_ROBUST) for p, r, at in pairs], problems[0].loss)
    elif meshed:
        members = [Member(with_mesh(r, at.y), p.stage_weights, p.limits, at.y, Schedule()) for p, r, at in reached]
        further = run(members, Squares())
    else:
        return ends
    return [joined(at, then) for at, then in zip(ends, further, strict=True)]


def joined(first: Iterate, then: Iterate) -> Iterate:
    """Two solutions, one going on from the other."""
    steps, stages = int(first.iterations) + int(then.iterations), int(first.stages) + int(then.stages)
    return then._replace(iterations=steps, stages=stages)


def on_all_samples(problem: Problem, residual: Residual, y: Any, schedule: Schedule) -> Member:
    """What is to be solved from coordinates `y` with all samples of a residual."""
    stages = tuple(full_stage(*pair) for pair in zip(problem.windows, residual.runs, strict=True))
    return Member(residual, stages, problem.limits, y, schedule)


def _refined(problem: Problem, at: Iterate, rounds: int, endings: tuple[int, ...]) -> Solution:
    """The fit checked, and while it is not accurate carried on with all samples, each time with a finer engine.

    Only a fit that ended in one of the ways `endings` is carried on. One that has stalled goes on until that has not
    paid twice in a row: where elements slip between the steps of a mesh, its optimum may be met on another one.
    """
    residual = problem.residual
    solution, before, in_vain = _checked(problem, residual, at), np.inf, 0
    for _ in range(rounds):
        in_vain = in_vain + 1 if solution.status == STALLED and not solution.chi2 < _PAYS * before else 0
        if solution.accurate or solution.status not in endings or in_vain == 2:
            break
        before = solution.chi2
        residual = _with_engine(residual, residual.engine.finer())
        try:
            target = with_mesh(without_inputs(residual), at.y)
            (then,) = one_by_one([on_all_samples(problem, target, at.y, CONTINUE)], problem.loss)
            then = joined(at, then)
            at, solution = then, _checked(problem, residual, then)
        except UsageError:
            # No mesh holds so many steps: the numerical shift tells what is left.
            break
    return solution


def _with_engine(residual: Residual, engine: AbstractEngine) -> Residual:
    return residual._replace(engine=engine)


def checking(residual: Residual, y: Any) -> Residual:
    """The residual with an engine that checks its own, on a mesh made at coordinates `y`."""
    return with_mesh(_with_engine(residual, residual.engine.checking()), y)


def with_inputs(residual: Residual, y: Any) -> np.ndarray:
    """Coordinates of the parameters, and behind them those of the inputs of the rig, at zero."""
    return np.concatenate([y, np.zeros(residual.inputs.shape[0])])


def evaluate_at(problem: Problem, residual: Residual, y: Any) -> Iterate:
    """The evaluation of all samples of a residual at coordinates `y` of parameters and inputs."""
    (at,) = one_by_one([on_all_samples(problem, residual, y, EVALUATE_ONLY)], problem.loss)
    return at


def _checked(problem: Problem, residual: Residual, at: Iterate) -> Solution:
    y = with_inputs(residual, at.y)
    return solution_of(problem, at, evaluate_at(problem, checking(residual, y), y))


def solution_of(problem: Problem, at: Iterate, looked: Iterate) -> Solution:
    """The solved fit from where the stages ended and what all samples say there, all of it as numpy arrays."""
    p, evaluation = at.y.size, looked.evaluation
    at_bound = (at.y <= problem.limits.lower) | (at.y >= problem.limits.upper)
    shape = quadratic(evaluation.gradient[:p], evaluation.normal[:p, :p], at_bound)
    variance = max(float(evaluation.chi2), _rounding(problem)) / problem.dof
    # A motion that has grown beyond all bounds is as good as not finite, and its squares overflow.
    evaluation = evaluation._replace(
        residual=np.where(np.abs(evaluation.residual) < _BOUNDLESS, evaluation.residual, np.nan)
    )
    return Solution(
        y=with_inputs(problem.residual, at.y),
        evaluation=evaluation,
        derived=looked.derived,
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
