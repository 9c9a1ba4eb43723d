"""What a fit came to: its status in words, the flags of its parameters, and how well the model describes the record."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data.record import Record
from ..data.repair import reported_faults
from ..estimation.covariance import Covariance
from ..estimation.loss import Squares
from ..estimation.space import Parameter
from ..estimation.status import NOT_FINITE, OUT_OF_STEPS, STALLED
from ..show import engineering
from .chunks import typical
from .noise import Noise
from .problem import Problem
from .solve import Solution
from .window import Window

CONVERGED, AT_BOUND, MISFIT = "converged", "at a bound", "does not describe the record"
_OPTIMA = (CONVERGED, AT_BOUND, MISFIT)
# Part of the amplitude that the error of a computed motion may reach, 0.02 nm on 2 mm: a record without noise, as a
# simulation writes it, is not described more closely.
_COMPUTED = 1e-8


class Misfit(NamedTuple):
    """The residuals of the run that is described worst, beside its noise.

    Attributes:
        size: root mean square of its residuals, or with a robust loss their median absolute value over 0.6745, in the
            unit of the record; of those in motion where these are larger, `in_motion`.
        noise: its noise, with what that found in it may add up to; `level`: as stated or as neighbouring samples show
            it; `stated`: as stated, inf where its size says nothing.
        run: its number.
        faults: what its record shows besides, a sentence for each by its repair, where they were looked for.
    """

    size: float
    noise: float
    stated: float
    level: float
    run: int
    in_motion: bool = False
    faults: Mapping[str, str] = {}

    @property
    def ratio(self) -> float:
        """Size in units of the noise."""
        return self.size / self.noise


def noise_level(window: Window, relative: bool = False) -> float:
    """Noise that the residuals of a record are compared with: as stated, or as seen in the record where that is larger.

    Args:
        window: the fitted part of the record.
        relative: whether stated noise only weighs the samples against each other, so that its size says nothing.
    """
    seen = max(window.segmentation.noise, _COMPUTED * window.segmentation.amplitude)
    return seen if relative else max(seen, window.stated)


def misfit_of(problem: Problem, solution: Solution, noises: Sequence[Noise], relative: bool) -> Misfit:
    """How large the residuals are beside the noise, in the run where that is the worst; drift and hum are noise."""
    sizes = []
    for part, window, noise in zip(problem.by_run(solution.evaluation.residual), problem.windows, noises, strict=True):
        t = np.asarray(window.trace.t) - window.origin
        left = np.where(window.used, part + noise.at(t) / window.sigma, 0.0)
        sizes.append(typical(left, window.used, window.moving, problem.loss))
    return worst(problem, sizes, [noise.expected for noise in noises], relative)


def worst(problem: Problem, sizes: Sequence[Sequence[float]], expected: Sequence[float], relative: bool) -> Misfit:
    """The run whose residuals are the largest in units of its noise.

    Args:
        problem: the problem.
        sizes: typical size of the weighted residuals of each run, over all and in motion.
        expected: that which its noise may have.
        relative: whether stated noise only weighs the samples.
    """
    misfits = []
    for run, ((over_all, moving), least, window) in enumerate(zip(sizes, expected, problem.windows, strict=True)):
        stated = window.stated
        level = noise_level(window, relative)
        # A long rest, which every model describes, would hide what one lacks in motion.
        size = float(np.maximum(over_all, moving)) * stated
        noise = max(level, least * stated)
        misfits.append(Misfit(size, noise, np.inf if relative else stated, level, run, bool(moving > over_all)))
    return max(misfits, key=lambda misfit: misfit.ratio)


def with_faults(problem: Problem, misfit: Misfit) -> Misfit:
    """The same with the faults of its record, which are looked for where residuals are larger than its noise."""
    if not misfit.size > thresholds.NOTICED * misfit.level:
        return misfit
    window = problem.windows[misfit.run]
    record = Record(window.trace, {"quantity": window.quantity})
    return misfit._replace(faults=reported_faults(record, of_run(misfit.run, problem)))


def of_run(number: int, problem: Problem) -> str:
    """Which run a sentence is about, where there are several: " of run 2"."""
    return "" if len(problem.windows) == 1 else f" of {problem.labels[number]}"


def optimum_found(status: str) -> bool:
    """Whether a status is that of an optimum that determines all parameters not held by a bound."""
    return status.split(":")[0] in _OPTIMA


def status_of(problem: Problem, solution: Solution, covariance: Covariance, misfit: Misfit) -> str:
    """The outcome in words; what stands before the colon is its name."""
    if solution.status == NOT_FINITE or not np.all(np.isfinite(solution.derived.values)):
        return "not finite: the model fails at the start values. Check the law's coefficients and the engine."
    if solution.status == OUT_OF_STEPS:
        return "out of steps: the optimum was not reached. Start nearer, free fewer parameters, or ask multistart()."
    if solution.status == STALLED:
        return (
            "stalled: no step improves the fit although the gradient asks for one. Check bounds and the law, or ask "
            "multistart() for better start values."
        )
    if not covariance.full_rank:
        lost = _listed(problem, covariance.undetermined)
        remedy = _repair(misfit) or "fix one of them or record more half-cycles"
        return f"undetermined: the record does not determine {lost}. {remedy.capitalize()}."
    at_bound = _listed(problem, covariance.at_bound)
    # A size that is not finite is no description either, and values that were repeated are no noise of any size.
    if not misfit.ratio <= thresholds.DESCRIBED or "dropouts" in misfit.faults:
        return f"{MISFIT}: {_compared(problem, misfit)}; {_remedy(problem, solution, misfit, at_bound)}."
    if at_bound:
        return f"{AT_BOUND}: {at_bound}. Widen the bound, fix what it holds, or take a law without it."
    return CONVERGED


def _listed(problem: Problem, which: np.ndarray) -> str:
    return ", ".join(name for name, true in zip(problem.names, which, strict=True) if true)


def _compared(problem: Problem, misfit: Misfit) -> str:
    unit = problem.windows[0].quantity
    size, noise = (engineering(value, unit) for value in (misfit.size, misfit.noise))
    where = " in motion" if misfit.in_motion else ""
    where += "" if len(problem.windows) == 1 else f" in {problem.labels[misfit.run]}"
    return f"residuals of {size}{where} are {misfit.ratio:.3g} times the noise of {noise}"


def _remedy(problem: Problem, solution: Solution, misfit: Misfit, at_bound: str) -> str:
    """What most likely keeps a model from describing its record."""
    if repair := _repair(misfit):
        return repair
    if isinstance(problem.loss, Squares) and _by_few(problem, solution, misfit.run):
        return "few samples far from all others hold most of that: mask them, or count them less with loss='huber'"
    if any(growth(window) for window in problem.windows):
        return "its swing grows with time: check the order of the samples"
    if at_bound:
        return f"{at_bound} is held at a bound, which may be the reason: widen it"
    if any(holds_release(window) for window in problem.windows):
        return "start at the first reversal, behind the transient of the release"
    return "plot them: choose another law, or look for fringe slips, vibration and drift"


def _repair(misfit: Misfit) -> str:
    """What mends the faults of a record; empty where it has none."""
    return f"read it with repair='{','.join(misfit.faults)}'" if misfit.faults else ""


def _by_few(problem: Problem, solution: Solution, run: int) -> bool:
    """Whether a fiftieth of the samples in motion holds nine tenths of the squares, as of spikes and of no motion.

    Convention: of a sinusoid it holds a twenty-fifth. A chunk of a batch keeps no residuals to look at.
    """
    if not solution.evaluation.residual.size:
        return False
    part, window = problem.by_run(solution.evaluation.residual)[run], problem.windows[run]
    squares = np.sort(np.square(part[window.moving]))[::-1]
    return bool(np.sum(squares[: squares.size // 50]) > 0.9 * np.sum(squares))


def holds_release(window: Window) -> bool:
    """Whether the half-cycle from the release to the first reversal is fitted."""
    reversals, half_period = window.segmentation.turning_times, window.segmentation.half_period
    return reversals.size > 0 and bool(window.origin < reversals[0] - 0.75 * half_period)


def growth(window: Window) -> tuple[float, float] | None:
    """First and last half-cycle of a record whose swing grows with time, which no free decay does; None for a decay."""
    segmentation = window.segmentation
    paths = np.abs(np.diff(segmentation.turning_points))
    if paths.size < 2:
        return None
    first, last = float(paths[0]), float(paths[-1])
    # One in a hundred is more than a beat between modes or the rounding of an encoder makes of a steady swing.
    grows = last - first > max(thresholds.EXTREME * segmentation.noise, 0.01 * first) and np.median(np.diff(paths)) > 0
    return (first, last) if grows else None


def flags_of(problem: Problem, covariance: Covariance, solution: Solution) -> dict[str, tuple[str, ...]]:
    """Flags of each parameter."""
    values, errors = solution.derived.values, np.sqrt(np.diag(covariance.statistical))
    flags: dict[str, tuple[str, ...]] = {}
    for i, parameter in enumerate(problem.parameters):
        raised = []
        if covariance.at_bound[i]:
            raised.append("at bound")
        elif covariance.undetermined[i]:
            raised.append("undetermined")
        elif parameter.fitted_as != "value" and errors[i] > thresholds.POORLY * values[i]:
            raised.append("hardly determined")
        if too_large(problem, parameter, values[i]):
            raised.append("implausible")
        if values[i] == parameter.start and not covariance.at_bound[i]:
            raised.append("at start value")
        flags[parameter.name] = tuple(raised)
    return flags


def too_large(problem: Problem, parameter: Parameter, value: float) -> bool:
    """Whether a value is a coefficient of friction larger than there are."""
    # Under unit load, which stands for an unknown one, mu is a deceleration or a dead band of any size.
    loaded = float(problem.residual.oscillator.normal_force) != 1.0
    return parameter.kind == "mu" and loaded and value > thresholds.LARGEST_MU
