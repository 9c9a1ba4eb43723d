"""Outcome of a fit: its status and the warnings of its trials.

The status follows from the trials, from the motion that the model leaves unexplained, and from its coefficients.
"""

from collections.abc import Iterator, Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ... import thresholds
from ...estimation.covariance import Covariance, quadratic
from ...show import engineering, rotary_unit
from ..diagnostics import DESCRIBED, Misfit, failure_of, growth, of_run
from ..names import of_run as belongs_to_run
from ..noise import Noise
from ..noise_weighting import NoiseWeighted
from ..problem import Problem
from ..solve import Solution
from .criterion import independent_noise
from .refits import Trial
from .unexplained import NEAR, Unexplained, rises, unexplained

# Standard errors beyond which the tail of a normal distribution is nearly exponential.
_TAIL = 30.0
_LOSSES = {"mu", "damping", "drag"}


class Outcome(NamedTuple):
    """Status of a fit with its warnings.

    Attributes:
        status: the outcome in words; its name precedes the colon or comma.
        warnings: sentences about the preferred trial and about unexplained motion.
        additional: covariance of the coordinates to add for a missing term, shape (p, p).
    """

    status: str
    warnings: tuple[str, ...]
    additional: np.ndarray


def conclude(weighted: NoiseWeighted, covariance: Covariance, misfit: Misfit, trials: Sequence[Trial] = ()) -> Outcome:
    """Return the outcome of a fit.

    Args:
        weighted: the fit.
        covariance: covariance of its parameters.
        misfit: its residuals relative to its noise.
        trials: the preferred model and its rivals, see :func:`.refits.alternatives`; empty without trials.
    """
    problem, solution = weighted.problem, weighted.solution
    p = len(problem.parameters)
    if weighted.plain:
        return Outcome(DESCRIBED, (), np.zeros((p, p)))
    failure = failure_of(problem, solution, covariance)
    if failure:
        return Outcome(failure, (), np.zeros((p, p)))
    left = unexplained(problem, solution, weighted.noises)
    better = next((trial for trial in trials[:1] if trial.names and _describes(trial, weighted.noises)), None)
    status = _refusal(weighted, covariance, misfit, left, better, trials[1:])
    shift = np.zeros(p) if better is None else _shift(problem, solution, better)
    return Outcome(
        status or _description(weighted, covariance, left, better),
        tuple(_warnings(problem, solution, left, better)),
        np.outer(shift, shift),
    )


def _describes(trial: Trial, noises: Sequence[Noise]) -> bool:
    """Return True if a trial leaves smaller residuals and describes the record."""
    level = max(independent_noise(trial.problem, run) * w.stated for run, w in enumerate(trial.problem.windows))
    left = unexplained(trial.problem, trial.solution, noises)
    near = trial.size < max(thresholds.DESCRIBED * level, trial.before / thresholds.DESCRIBED)
    return trial.size < trial.before and left.share <= thresholds.UNDESCRIBED and near


def _refusal(
    weighted: NoiseWeighted,
    covariance: Covariance,
    misfit: Misfit,
    left: Unexplained,
    better: Trial | None,
    rivals: Sequence[Trial],
) -> str:
    """Return the status of a model that misses its record."""
    problem, solution = weighted.problem, weighted.solution
    if any(growth(window) for window in problem.windows):
        return "no free decay: growing, the amplitude is larger at the end than at the start."
    if better is not None and _is_material(weighted, covariance, misfit, left, better):
        names = " or ".join([" and ".join(better.names), *(trial.names[-1] for trial in rivals)])
        return f"does not describe: {names} would ({_sizes(problem, better, ' -> ')}); fit {better.how}."
    if left.share > thresholds.UNDESCRIBED or (
        left.share > thresholds.UNEXPLAINED and left.late > thresholds.UNDESCRIBED
    ):
        return _no_free_decay(problem, solution, left)
    negative = _negative(problem, solution, covariance)
    if negative:
        return f"does not describe: no cause found; {negative}."
    # A size that is not finite is a misfit too. Repeated values are dropouts, not noise.
    if not misfit.ratio <= thresholds.DESCRIBED or "dropouts" in misfit.faults:
        return f"does not describe: no cause found; {misfit.words(problem)}."
    bounded = _at_bound(problem, solution, covariance)
    if bounded:
        return f"at a bound: {', '.join(bounded)}. Widen the bound, fix this parameter, or use a law without it."
    if _without_loss(problem, solution, covariance):
        return "no free decay: no loss seen, neither friction nor damping is significant."
    return ""


def _at_bound(problem: Problem, solution: Solution, covariance: Covariance) -> list[str]:
    """Return the parameters at a bound, except friction of zero."""
    each = zip(problem.parameters, solution.derived.values, covariance.at_bound, strict=True)
    return [parameter.name for parameter, value, at in each if at and not (parameter.kind == "mu" and value == 0)]


def _no_free_decay(problem: Problem, solution: Solution, left: Unexplained) -> str:
    """Return the status of a motion that no trial explains."""
    natural, where = float(solution.derived.kinematics[0]), of_run(left.run, problem)
    size = f"{engineering(left.size, problem.windows[left.run].quantity)} ({100 * left.share:.2g} % of the motion)"
    if rises(problem.windows[left.run]):
        return f"no free decay: beating or driven, the amplitude{where} rises again, and {size} are unexplained."
    if left.at_rest:
        return f"no free decay: driven, the mass{where} moves by {size} where it should rest."
    if abs(left.frequency - natural) > NEAR * natural:
        return f"no free decay: second mode{where} at {engineering(left.frequency, 'Hz')}, {size} are unexplained."
    return f"does not describe: no cause found; {size}{where} are unexplained."


def _description(weighted: NoiseWeighted, covariance: Covariance, left: Unexplained, better: Trial | None) -> str:
    """Return the status of a fit that describes its record."""
    window, status = weighted.problem.windows[left.run], "described"
    limit = _limit(weighted, covariance)
    if limit is not None:
        status = f"no dry friction: dead band < {engineering(limit, window.motion)} (95 %)"
    if better is not None:
        status += f", small {' and '.join(better.names)}"
    if left.share > thresholds.UNEXPLAINED:
        status += f", unexplained motion of {engineering(left.size, window.quantity)} ({100 * left.share:.2g} %)"
    return status


def _is_material(
    weighted: NoiseWeighted, covariance: Covariance, misfit: Misfit, left: Unexplained, better: Trial
) -> bool:
    """Return True if a term changes the result.

    It does if it moves a coefficient by more than the errors of both fits, or if the residuals without it are far above
    the noise.
    """
    if not misfit.ratio <= thresholds.DESCRIBED or left.share > thresholds.UNDESCRIBED or misfit.faults:
        return True
    problem, solution, other = weighted.problem, weighted.solution, better.solution
    shift = _shift(problem, solution, better) * solution.derived.slope
    scatter = np.sqrt(other.shape.inverse.diagonal() * other.chi2 / better.problem.dof) * other.derived.slope
    errors = dict(zip(better.problem.names, scatter, strict=True))
    for name, moved, variance in zip(problem.names, shift, np.diag(covariance.statistical), strict=True):
        error = float(np.hypot(np.sqrt(variance), errors.get(name, 0.0)))
        if not belongs_to_run(name) and abs(moved) > thresholds.SUSPECTED * error:
            return True
    return False


def _shift(problem: Problem, solution: Solution, better: Trial) -> np.ndarray:
    """Return the change of the coordinates by a trial, shape (p,)."""
    values, slope = solution.derived.values, solution.derived.slope
    other = np.array([better.values.get(name, value) for name, value in zip(problem.names, values, strict=True)])
    return np.divide(other - values, slope, out=np.zeros(slope.shape), where=slope != 0)


def _negative(problem: Problem, solution: Solution, covariance: Covariance) -> str:
    """Return words about friction or damping below zero."""
    errors = np.sqrt(np.diag(covariance.statistical))
    for parameter, value, error in zip(problem.parameters, solution.derived.values, errors, strict=True):
        if parameter.kind in ("mu", "damping") and value < -thresholds.SUSPECTED * error:
            return f"{parameter.name} is negative by {-value / error:.2g} standard errors, as in no passive machine"
    return ""


def _without_loss(problem: Problem, solution: Solution, covariance: Covariance) -> bool:
    """Return words about friction or damping below zero."""
    kinds = {parameter.kind for parameter in problem.parameters}
    if not {"mu", "damping"} <= kinds or solution.derived.machine.friction.kind != "set-valued":
        return False
    lossy = [i for i, p in enumerate(problem.parameters) if p.kind in _LOSSES and not covariance.at_bound[i]]
    values, matrix = np.asarray(solution.derived.values)[lossy], covariance.statistical[np.ix_(lossy, lossy)]
    return not float(values @ np.linalg.lstsq(matrix, values, rcond=None)[0]) > thresholds.DECISIVE


def _limit(weighted: NoiseWeighted, covariance: Covariance) -> float | None:
    """Return the 95 % limit of a dead band of zero.

    The likelihood near the bound is normal, and only positive values are possible.
    """
    problem, solution = weighted.problem, weighted.solution
    values, machine, p = solution.derived.values, solution.derived.machine, len(problem.parameters)
    zero = [i for i, each in enumerate(problem.parameters) if each.kind == "mu" and covariance.at_bound[i]]
    if not zero or values[zero[0]] != 0:
        return None
    others = covariance.at_bound.copy()
    others[zero[0]] = False
    free = quadratic(solution.evaluation.gradient[:p], solution.evaluation.normal[:p, :p], others)
    std = float(np.sqrt(weighted.variance * free.inverse[zero[0], zero[0]] + weighted.unsure[zero[0], zero[0]]))
    below = max(-float(free.step[zero[0]]) / std, 0.0) if std > 0 else 0.0
    normal = NormalDist()
    upper = -np.log(0.05) / below if below > _TAIL else -normal.inv_cdf(0.05 * normal.cdf(-below)) - below
    return float(std * upper * solution.derived.slope[zero[0]] * machine.normal_force / machine.stiffness)


def _warnings(problem: Problem, solution: Solution, left: Unexplained, better: Trial | None) -> Iterator[str]:
    """Yield sentences about the preferred trial and about unexplained motion."""
    unit = problem.windows[left.run].quantity
    if better is not None:
        names, moved = " and ".join(better.names), []
        for parameter, value in zip(problem.parameters, solution.derived.values, strict=True):
            if parameter.name in better.values and not belongs_to_run(parameter.name):
                change = f"{better.values[parameter.name] - float(value):.2g} {rotary_unit(parameter.unit, unit)}"
                moved.append(f"{parameter.name} by {change}".rstrip())
        moves = f" It moves {', '.join(moved)}." if moved else ""
        yield (
            f"{names[0].upper()}{names[1:]} was tried: the residuals in motion fall from "
            f"{_sizes(problem, better, ' to ')}, a gain of {better.gain:.3g} in the criterion.{moves} Fit {better.how}."
        )
    if thresholds.UNEXPLAINED < left.share <= thresholds.UNDESCRIBED:
        yield (
            f"{engineering(left.size, unit)} of the motion{of_run(left.run, problem)} ({100 * left.share:.2g} %) are "
            "unexplained. The standard errors include them as noise."
        )


def _sizes(problem: Problem, better: Trial, between: str) -> str:
    """Return the residuals before and after a trial."""
    return between.join(engineering(size, problem.windows[0].quantity) for size in (better.before, better.size))
