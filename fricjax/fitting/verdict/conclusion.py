"""Status of a fit: described, not described and why, or no free decay.

The status follows from the trials, from the motion that the model leaves unexplained, and from its coefficients.
"""

from collections.abc import Iterator, Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ... import thresholds
from ...estimation.covariance import Covariance, quadratic
from ...show import engineering, rotary_unit
from ..diagnostics import Misfit, failure_of, growth, of_run
from ..names import of_run as is_of_run
from ..noise import Noise
from ..noise_weighting import NoiseWeighted
from ..problem import Problem
from ..solve import Solution
from .criterion import independent_noise
from .trials import Trial
from .unexplained import NEAR, Unexplained, rises, unexplained

# Beyond so many standard errors the tail of a normal distribution is that of an exponential one.
_TAIL = 30.0
_LOSSES = {"mu", "damping", "drag"}


class Verdict(NamedTuple):
    """Outcome of a fit.

    Attributes:
        status: the outcome in words; its name precedes the colon or comma.
        remarks: sentences about trials and unexplained motion, at most three.
        additional: covariance of the coordinates to add for a missing term, shape (p, p).
    """

    status: str
    remarks: tuple[str, ...]
    additional: np.ndarray


def conclude(weighted: NoiseWeighted, covariance: Covariance, misfit: Misfit, found: Sequence[Trial] = ()) -> Verdict:
    """Return the verdict on a fit.

    Args:
        weighted: the fit.
        covariance: covariance of its parameters.
        misfit: its residuals relative to its noise.
        found: the preferred model and its rivals, as :func:`.trials.trials` returns them; empty without trials.
    """
    problem, solution = weighted.problem, weighted.solution
    p = len(problem.parameters)
    none = np.zeros((p, p))
    failure = failure_of(problem, solution, covariance)
    if failure:
        return Verdict(failure, (), none)
    left = unexplained(problem, solution, weighted.noises)
    winner = found[0] if found and found[0].names else None
    if winner is not None and not _helps(winner, weighted.noises):
        winner = None
    remarks = tuple(_remarks(weighted, covariance, left, winner))
    status = _refusal(weighted, covariance, misfit, left, winner, found)
    shift = np.zeros(p) if winner is None else _shift(problem, solution, winner)
    return Verdict(status or _described(weighted, covariance, left, winner), remarks, np.outer(shift, shift))


def _helps(trial: Trial, noises: Sequence[Noise]) -> bool:
    """Return True if a trial describes the record better than the asked model, and well enough."""
    level = max(independent_noise(trial.problem, run) * w.stated for run, w in enumerate(trial.problem.windows))
    left = unexplained(trial.problem, trial.solution, noises)
    near = trial.size < max(thresholds.DESCRIBED * level, trial.before / thresholds.DESCRIBED)
    return trial.size < trial.before and left.share <= thresholds.UNDESCRIBED and near


def _refusal(
    weighted: NoiseWeighted,
    covariance: Covariance,
    misfit: Misfit,
    left: Unexplained,
    winner: Trial | None,
    found: Sequence[Trial],
) -> str:
    """Return the status of a fit that does not describe its record, else an empty text."""
    problem, solution = weighted.problem, weighted.solution
    if any(growth(window) for window in problem.windows):
        return "no free decay: growing, the amplitude is larger at the end than at the start."
    if winner is not None and _is_material(weighted, covariance, misfit, left, winner):
        rivals = [trial.names[-1] for trial in found[1:]]
        names = " or ".join([" and ".join(winner.names), *rivals])
        unit = problem.windows[0].quantity
        sizes = " -> ".join(engineering(size, unit) for size in (winner.before, winner.size))
        return f"does not describe: {names} would ({sizes}); fit {winner.how}."
    if left.share > thresholds.UNDESCRIBED:
        return _no_free_decay(problem, solution, left)
    negative = _negative(problem, solution, covariance)
    if negative:
        return f"does not describe: no cause found; {negative}."
    # A size that is not finite is a misfit too. Repeated values are dropouts, not noise.
    if not misfit.ratio <= thresholds.DESCRIBED or "dropouts" in misfit.faults:
        return f"does not describe: no cause found; {misfit.words(problem)}."
    bound = [name for name, at in zip(problem.names, covariance.at_bound, strict=True) if at and not _is_zero(name)]
    if bound:
        return f"at a bound: {', '.join(bound)}. Widen the bound, fix this parameter, or use a law without it."
    if _without_loss(problem, solution, covariance):
        return "no free decay: no loss seen, neither friction nor damping is significant."
    return ""


def _described(weighted: NoiseWeighted, covariance: Covariance, left: Unexplained, winner: Trial | None) -> str:
    """Return the status of a fit that describes its record."""
    problem = weighted.problem
    unit = problem.windows[left.run].quantity
    status = "described"
    limit = _limit(weighted, covariance)
    if limit is not None:
        status = f"no dry friction: dead band < {engineering(limit, unit)} (95 %)"
    if winner is not None:
        status += f", small {' and '.join(winner.names)}"
    if left.share > thresholds.UNEXPLAINED:
        status += f", unexplained motion of {engineering(left.size, unit)} ({100 * left.share:.2g} %)"
    return status


def _no_free_decay(problem: Problem, solution: Solution, left: Unexplained) -> str:
    """Return the status of a motion that no trial explains."""
    unit, natural = problem.windows[left.run].quantity, float(solution.derived.kinematics[0])
    size = f"{engineering(left.size, unit)} ({100 * left.share:.2g} % of the motion)"
    where = of_run(left.run, problem)
    if rises(problem.windows[left.run]):
        return f"no free decay: beating or driven, the amplitude{where} rises again, and {size} are unexplained."
    if left.at_rest:
        return f"no free decay: driven, the mass{where} moves by {size} where it should rest."
    if abs(left.frequency - natural) > NEAR * natural:
        return f"no free decay: second mode{where} at {engineering(left.frequency, 'Hz')}, {size} are unexplained."
    return f"does not describe: no cause found; {size}{where} are unexplained."


def _is_material(
    weighted: NoiseWeighted, covariance: Covariance, misfit: Misfit, left: Unexplained, winner: Trial
) -> bool:
    """Return True if a term moves a value beyond its errors, or if the residuals are far above the noise."""
    if not misfit.ratio <= thresholds.DESCRIBED or left.share > thresholds.UNDESCRIBED or misfit.faults:
        return True
    problem, solution = weighted.problem, weighted.solution
    shift = _shift(problem, solution, winner) * solution.derived.slope
    own = winner.solution.shape.inverse.diagonal() * winner.solution.chi2 / winner.problem.dof
    theirs = dict(zip(winner.problem.names, np.sqrt(own) * winner.solution.derived.slope, strict=True))
    errors = np.sqrt(np.diag(covariance.statistical))
    combined = np.array([np.hypot(e, theirs.get(n, 0.0)) for n, e in zip(problem.names, errors, strict=True)])
    shared = np.array([not is_of_run(name) for name in problem.names])
    moved = np.abs(shift[shared]) / np.where(combined[shared] > 0, combined[shared], np.inf)
    return bool(np.max(moved, initial=0.0) > thresholds.SUSPECTED)


def _shift(problem: Problem, solution: Solution, winner: Trial) -> np.ndarray:
    """Return the change of the coordinates by a trial, shape (p,)."""
    values, slope = solution.derived.values, solution.derived.slope
    other = np.array([winner.values.get(name, value) for name, value in zip(problem.names, values, strict=True)])
    return np.where(slope != 0, (other - values) / np.where(slope != 0, slope, 1.0), 0.0)


def _negative(problem: Problem, solution: Solution, covariance: Covariance) -> str:
    """Return words about significantly negative friction or damping, if any."""
    errors = np.sqrt(np.diag(covariance.statistical))
    for parameter, value, error in zip(problem.parameters, solution.derived.values, errors, strict=True):
        if parameter.kind in ("mu", "damping") and value < -thresholds.SUSPECTED * error:
            return f"{parameter.name} is negative by {-value / error:.2g} standard errors, which no passive machine has"
    return ""


def _without_loss(problem: Problem, solution: Solution, covariance: Covariance) -> bool:
    """Return True if the free losses together do not differ from zero."""
    lossy = [i for i, parameter in enumerate(problem.parameters) if parameter.kind in _LOSSES]
    kinds = {problem.parameters[i].kind for i in lossy}
    if not {"mu", "damping"} <= kinds or not all(
        law.kind == "set-valued" for law in (solution.derived.machine.friction,)
    ):
        return False
    lossy = [i for i in lossy if not covariance.at_bound[i]]
    values = np.asarray(solution.derived.values)[lossy]
    matrix = covariance.statistical[np.ix_(lossy, lossy)]
    return not float(values @ np.linalg.lstsq(matrix, values, rcond=None)[0]) > thresholds.DECISIVE


def _is_zero(name: str) -> bool:
    """Return True for a coefficient of dry friction, whose bound is zero."""
    return name.rsplit(".", 1)[-1] == "mu"


def _limit(weighted: NoiseWeighted, covariance: Covariance) -> float | None:
    """Return the 95 % upper limit of the dead band if friction is at its bound of zero, else None.

    The likelihood near the bound is that of a normal distribution, of which only positive values are possible.
    """
    problem, solution = weighted.problem, weighted.solution
    places = [i for i, name in enumerate(problem.names) if _is_zero(name) and covariance.at_bound[i]]
    if not places or solution.derived.values[places[0]] != 0:
        return None
    place, p = places[0], len(problem.names)
    others = covariance.at_bound.copy()
    others[place] = False
    free = quadratic(solution.evaluation.gradient[:p], solution.evaluation.normal[:p, :p], others)
    variance = weighted.variance * free.inverse[place, place] + weighted.unsure[place, place]
    std, mean = float(np.sqrt(variance)), float(free.step[place])
    below = max(-mean / std, 0.0) if std > 0 else 0.0
    normal = NormalDist()
    if below > _TAIL:
        upper = -std * float(np.log(0.05)) / below
    else:
        upper = std * (-normal.inv_cdf(0.05 * normal.cdf(-below)) - below)
    machine = solution.derived.machine
    return upper * float(solution.derived.slope[place]) * float(machine.normal_force) / float(machine.stiffness)


def _remarks(weighted: NoiseWeighted, covariance: Covariance, left: Unexplained, winner: Trial | None) -> Iterator[str]:
    """Yield sentences about the preferred trial and about unexplained motion."""
    problem, solution = weighted.problem, weighted.solution
    unit = problem.windows[left.run].quantity
    if winner is not None:
        values, moved = winner.values, []
        for parameter, value in zip(problem.parameters, solution.derived.values, strict=True):
            if parameter.name in values and not is_of_run(parameter.name):
                change = values[parameter.name] - float(value)
                moved.append(f"{parameter.name} by {change:.2g} {rotary_unit(parameter.unit, unit)}".rstrip())
        names = " and ".join(winner.names)
        sizes = " to ".join(engineering(size, unit) for size in (winner.before, winner.size))
        moves = f" It moves {', '.join(moved)}." if moved else ""
        yield (
            f"{names[0].upper()}{names[1:]} was tried: the residuals in motion fall from {sizes}, a gain of "
            f"{winner.gain:.3g} in the criterion.{moves} Fit {winner.how}."
        )
    if thresholds.UNEXPLAINED < left.share <= thresholds.UNDESCRIBED:
        yield (
            f"{engineering(left.size, unit)} of the motion{of_run(left.run, problem)} ({100 * left.share:.2g} %) are "
            "unexplained. The standard errors include them as noise."
        )
