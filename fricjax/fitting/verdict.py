"""What the numbers of a fit are worth: status, flags and warnings in words."""

import numpy as np

from .covariance import Covariance
from .problem import Problem
from .rest import Margin
from .solve import Solved
from .status import NOT_FINITE, OUT_OF_STEPS, STALLED
from .whiteness import Whiteness
from .window import Window

_ADEQUATE = 3.0
_VISIBLE = 0.1
NOTABLE = 1.5
# Standard error of a positive quantity, in parts of its value, from which on the record hardly tells it.
_HARDLY = 0.5
# Part of the stiffness beyond which no record tells a contact from a rigid one, from which on it counts as such.
_RIGID = 1 - 1e-6


def too_small(inflation: float) -> str:
    """Remark on a standard error that white noise would have been needed for."""
    return f"standard error too small, about x{inflation:.2g}"


def status_of(solved: Solved, covariance: Covariance, names: tuple[str, ...]) -> str:
    """The outcome in words."""
    if solved.status == NOT_FINITE:
        return "not finite: the model fails at the start values. Check the law's coefficients and the engine."
    if solved.status == OUT_OF_STEPS:
        return "out of steps: the optimum was not reached. Start nearer, or free fewer parameters."
    if solved.status == STALLED:
        return "stalled: no step improves the fit although the gradient asks for one. Check bounds and the law."
    if not covariance.full_rank:
        lost = ", ".join(n for n, bad in zip(names, covariance.undetermined, strict=True) if bad)
        return f"undetermined: the record does not determine {lost}. Fix one of them or record more half-cycles."
    held = [n for n, bound in zip(names, covariance.at_bound, strict=True) if bound]
    return f"converged with {', '.join(held)} at a bound" if held else "converged"


def flags_of(problem: Problem, covariance: Covariance, solved: Solved, inflation: float) -> dict[str, tuple[str, ...]]:
    """Flags of each parameter."""
    values, errors = solved.settled.values, np.sqrt(np.diag(covariance.statistical))
    flags: dict[str, tuple[str, ...]] = {}
    for i, parameter in enumerate(problem.parameters):
        found = []
        if covariance.at_bound[i]:
            found.append("at bound")
        elif covariance.undetermined[i]:
            found.append("undetermined")
        elif parameter.fitted_as != "value" and errors[i] > _HARDLY * values[i]:
            found.append("hardly determined")
        if values[i] == parameter.start and not covariance.at_bound[i]:
            found.append("at start value")
        if inflation > NOTABLE and not found:
            found.append(too_small(inflation))
        flags[parameter.name] = tuple(found)
    return flags


def _holds_release(window: Window) -> bool:
    """Whether the stroke from the release to the first reversal is fitted."""
    reversals, stroke = window.segmentation.turning_times, window.segmentation.half_period
    return reversals.size > 0 and bool(window.origin < reversals[0] - 0.75 * stroke)


def error_inflation(white: Whiteness, chi2_reduced: float, sigma_mode: str) -> float:
    """Factor by which correlated residuals, and noise larger than stated, make the standard errors too small."""
    excess = max(chi2_reduced, 1.0) if sigma_mode == "absolute" else 1.0
    return float(np.sqrt((1.0 if white.white else white.correlation_time) * excess))


def warnings_of(
    problem: Problem,
    values: dict[str, float],
    std_errors: dict[str, float],
    white: Whiteness,
    inflation: float,
    rms: float,
    margins: tuple[Margin | None, ...],
    excesses: tuple[float | None, ...],
    numerical_shift: float,
) -> tuple[str, ...]:
    """Sentences that a reader of the numbers must know."""
    sigma = float(np.median(np.concatenate([w.sigma[w.used] for w in problem.windows])))
    unit = problem.windows[0].quantity
    found = []
    if values.get("damping", 0.0) < -2 * std_errors.get("damping", np.inf):
        found.append(
            "The damping is negative: no passive machine has that. It is the fingerprint of a friction law that falls "
            "with velocity or of a missing term such as drag; bound it at zero or choose another law."
        )
    if rms > _ADEQUATE * sigma:
        found.append(
            f"The model does not describe the run: its residuals of {rms:.2e} {unit} rms are {rms / sigma:.3g} times "
            f"the noise of {sigma:.2e} {unit}."
        )
        if any(_holds_release(window) for window in problem.windows):
            found.append(
                "The window includes the release, whose transient biases friction. Start at the first reversal, which "
                "is the default."
            )
    rigid = [p.name for p in problem.parameters if values[p.name] >= _RIGID * p.rigid]
    if rigid:
        found.append(
            f"The record does not tell the contact from a rigid one, where {' and '.join(rigid)} would be infinite. "
            "A law without it, such as Coulomb, says the same with fewer coefficients."
        )
    if not {"mass", "stiffness"} & {parameter.kind for parameter in problem.parameters}:
        found.append(
            "The natural frequency is held fixed, although the trace knows it far better than any calibration. Free "
            "the stiffness."
        )
    if not white.white:
        found.append(
            f"The residuals are not white (neighbouring samples correlate by {white.lag_one:.2f}), so the standard "
            f"errors are too small, by a factor of about {inflation:.2g}."
        )
    if numerical_shift > _VISIBLE:
        found.append(
            f"The numerical error of the computed motion may move a parameter by {numerical_shift:.2g} standard "
            "errors. Ask the engine for more accuracy, or choose another engine."
        )
    for i, margin in enumerate(margins):
        if margin is not None and min(margin) < -_ADEQUATE * sigma:
            which = "" if len(margins) == 1 else f" of run {i}"
            found.append(
                f"The law would stop the mass{which} after another number of half-cycles than the record shows "
                f"(margins {margin.one_more:.2e}, {margin.one_less:.2e} {unit}): static friction or the model is off."
            )
    for i, excess in enumerate(excesses):
        if excess is not None and excess < -_ADEQUATE * sigma:
            which = "" if len(excesses) == 1 else f" of run {i}"
            found.append(
                f"The law would stop the mass{which} inside the record, which shows it moving to the end: at a "
                f"reversal the spring lacks {-excess:.2e} {unit} to overcome static friction. Static friction or the "
                "model is off."
            )
    return tuple(found)
