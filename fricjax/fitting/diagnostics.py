"""Diagnostics of a fit: its status, flags of its parameters, and misfit."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .. import thresholds
from ..data.record import Record
from ..data.repair import reported_faults
from ..estimation.covariance import Covariance
from ..estimation.space import Parameter
from ..estimation.status import NOT_FINITE, OUT_OF_STEPS, STALLED
from ..show import engineering
from .chunks import typical
from .noise import Noise
from .problem import Problem
from .solve import Solution
from .window import Window

DESCRIBED = "described"
"""Name of the usual outcome."""
# Names of the outcomes with an optimum; the first two describe the record.
_DESCRIBED = (DESCRIBED, "no dry friction")
_OPTIMA = (*_DESCRIBED, "at a bound", "does not describe", "no free decay")
# Error of the computed motion relative to the amplitude, 0.02 nm on 2 mm. Smaller residuals are not expected, even for
# a noise-free record from a simulation.
_COMPUTED = 1e-8


class Misfit(NamedTuple):
    """The run with the largest residuals relative to its noise.

    Attributes:
        size: root mean square of its residuals, or for a robust loss their median absolute value over 0.6745, in the
            unit of the record. If residuals in motion are larger, it covers those only, and `in_motion` is True.
        noise: noise level to compare with, including slow noise; `level`: the larger of the stated level and that from
            neighbouring samples; `stated`: as stated, inf if only relative weights were stated.
        run: its number.
        faults: faults of its record, a sentence for each by the name of its repair; empty if not searched for.
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

    def words(self, problem: Problem) -> str:
        """Compare size and noise in words."""
        size, noise = (engineering(value, problem.windows[0].quantity) for value in (self.size, self.noise))
        where = " in motion" if self.in_motion else ""
        where += "" if len(problem.windows) == 1 else f" in {problem.labels[self.run]}"
        return f"residuals of {size}{where} are {self.ratio:.3g} times the noise of {noise}"


def noise_level(window: Window, relative: bool = False) -> float:
    """Return the noise level for comparison with the residuals of a record.

    It is the stated level, or the level seen in the record if that is larger.

    Args:
        window: the fitted part of the record.
        relative: if True, stated noise gives only relative weights, so its size is ignored.
    """
    seen = window.gain * max(window.segmentation.noise, _COMPUTED * window.segmentation.amplitude)
    return seen if relative else max(seen, window.stated)


def misfit_of(problem: Problem, solution: Solution, noises: Sequence[Noise], relative: bool) -> Misfit:
    """Return the worst misfit of all runs; drift and hum are noise."""
    sizes = []
    for part, window, noise in zip(problem.by_run(solution.evaluation.residual), problem.windows, noises, strict=True):
        t = np.asarray(window.trace.t) - window.origin
        left = np.where(window.used, part + noise.at(t) / window.sigma, 0.0)
        sizes.append(typical(left, window.used, window.moving, problem.loss))
    return worst(problem, sizes, [noise.expected for noise in noises], relative)


def worst(problem: Problem, sizes: Sequence[Sequence[float]], expected: Sequence[float], relative: bool) -> Misfit:
    """Return the misfit of the run with the largest residual-to-noise ratio.

    Args:
        problem: the problem.
        sizes: typical size of the weighted residuals of each run, overall and in motion.
        expected: size that the noise of each run may have.
        relative: if True, stated noise gives only relative weights.
    """
    misfits = []
    for run, ((over_all, moving), least, window) in enumerate(zip(sizes, expected, problem.windows, strict=True)):
        stated = window.stated
        level = noise_level(window, relative)
        # A long rest, which every model fits, would hide a misfit in motion.
        size = float(np.maximum(over_all, moving)) * stated
        noise = max(level, least * stated)
        misfits.append(Misfit(size, noise, np.inf if relative else stated, level, run, bool(moving > over_all)))
    return max(misfits, key=lambda misfit: misfit.ratio)


def with_faults(problem: Problem, misfit: Misfit) -> Misfit:
    """Add the faults of the record if its residuals exceed its noise."""
    if not misfit.size > thresholds.NOTICED * misfit.level:
        return misfit
    window = problem.windows[misfit.run]
    record = Record(window.trace, window.observation.meta)
    return misfit._replace(faults=reported_faults(record, of_run(misfit.run, problem)))


def of_run(number: int, problem: Problem) -> str:
    """Return " of run 2" for a sentence, if there are several."""
    return "" if len(problem.windows) == 1 else f" of {problem.labels[number]}"


def optimum_found(status: str) -> bool:
    """Return True if the status names an optimum of full rank."""
    return _name(status) in _OPTIMA


def describes(status: str) -> bool:
    """Return True if the status names a fit that describes its record."""
    return _name(status) in _DESCRIBED


def _name(status: str) -> str:
    return status.split(":")[0].split(",")[0]


def failure_of(problem: Problem, solution: Solution, covariance: Covariance) -> str:
    """Return the status of a fit without a valid optimum, else ""."""
    if solution.status == NOT_FINITE or not np.all(np.isfinite(solution.derived.values)):
        return "not finite: the model fails at the start values. Check the law's coefficients and the engine."
    if solution.status == OUT_OF_STEPS:
        return "out of steps: the optimum was not reached. Start nearer, free fewer parameters, or use multistart()."
    if solution.status == STALLED:
        return (
            "stalled: no step improves the fit although the gradient is not zero. Check bounds and the law, or use "
            "multistart() for better start values."
        )
    if not covariance.full_rank:
        lost = ", ".join(name for name, at in zip(problem.names, covariance.undetermined, strict=True) if at)
        return f"undetermined: the record does not determine {lost}. Fix one of them or record more half-cycles."
    return ""


def holds_release(window: Window) -> bool:
    """Return True if the half-cycle before the first reversal is fitted."""
    reversals, half_period = window.segmentation.turning_times, window.segmentation.half_period
    return reversals.size > 0 and bool(window.origin < reversals[0] - 0.75 * half_period)


def growth(window: Window) -> tuple[float, float] | None:
    """Return first and last half-cycle [m] if the amplitude grows, else None."""
    segmentation = window.segmentation
    paths = np.abs(np.diff(segmentation.turning_points))
    if paths.size < 2:
        return None
    first, last = float(paths[0]), float(paths[-1])
    # Beats between modes and the rounding of an encoder change a steady amplitude by less than 1 %.
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
    """Return True if mu is implausibly large."""
    # A unit load means that the load is unknown; mu is then a deceleration or a dead band of any size.
    loaded = float(problem.residual.oscillator.normal_force) != 1.0
    return parameter.kind == "mu" and loaded and value > thresholds.LARGEST_MU
