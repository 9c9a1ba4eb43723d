"""Warnings about a fit, in sentences."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .. import thresholds
from ..data.inspect import implausible_scale
from ..oscillator.restoring import Pendulum
from ..show import engineering, plain
from .diagnostics import Misfit, growth, holds_release, of_run, too_large
from .noise_weighting import AlternativeCount
from .problem import Problem
from .rest import Bracket, Margin
from .solve import half_cycles

# Part of the largest resolvable stiffness above which a contact counts as rigid.
_RIGID = 1 - 1e-6


def warnings_of_model(
    problem: Problem,
    values: Mapping[str, float],
    margins: tuple[Margin | None, ...],
    excesses: tuple[float | None, ...],
    bracket: Bracket | None,
    numerical_shift: float,
) -> Iterator[str]:
    """Yield warnings about the model and the stops.

    They are for single fits only.

    Args:
        problem: the problem that was solved.
        values: fitted values by name.
        margins: for each run the distance to another number of half-cycles.
        excesses: for each run that ends in motion the least excess deflection at its reversals.
        bracket: interval of the static coefficient of a Coulomb law.
        numerical_shift: largest change of a parameter by numerical errors, in standard errors.
    """
    yield from _on_the_model(problem, values)
    yield from _on_the_errors(numerical_shift)
    yield from _on_the_rest(problem, margins, excesses)
    yield from _on_static_friction(bracket)


def warnings_of_run(
    problem: Problem,
    values: Mapping[str, float],
    misfit: Misfit,
    others: Sequence[AlternativeCount],
) -> Iterator[str]:
    """Yield warnings about a record and its fitted values.

    They are for single fits and batches.

    Args:
        problem: the problem that was solved.
        values: fitted values by name.
        misfit: its residuals relative to its noise.
        others: other numbers of half-cycles that the record leaves possible.
    """
    unit = problem.windows[0].quantity
    yield from implausible(problem, values)
    yield from _on_growth(problem)
    yield from _on_other_numbers(problem, others)
    size = f"{misfit.size:.2e} {unit} rms{' in motion' if misfit.in_motion else ''}"
    yield from misfit.faults.values()
    if misfit.ratio > thresholds.NOTICED:
        # The status reports larger residuals.
        if misfit.ratio <= thresholds.DESCRIBED:
            yield (
                f"The residuals of {size} are {misfit.ratio:.3g} times the noise of {misfit.noise:.2e} {unit}. They "
                "are treated as slow noise, but could also be model error."
            )
        yield from _on_drift(problem, misfit)
        if any(holds_release(window) for window in problem.windows):
            yield (
                "The window includes the release, and its transient biases friction. Start at the first reversal, "
                "which is the default."
            )
    elif misfit.size > thresholds.NOTICED * misfit.level:
        yield (
            f"The residuals of {size} are {misfit.size / misfit.level:.3g} times the noise of {misfit.level:.2e} "
            f"{unit} between adjacent samples. The identified noise model can explain this, but so can an error of the "
            "model."
        )
    elif misfit.size > thresholds.NOTICED * misfit.stated:
        yield (
            f"The noise is larger than stated: the residuals of {size} are {misfit.size / misfit.stated:.3g} times the "
            f"stated {misfit.stated:.2e} {unit}. Adjacent samples of the record show the same noise."
        )


def _on_other_numbers(problem: Problem, others: Sequence[AlternativeCount]) -> Iterator[str]:
    """Yield one sentence for each run with an uncertain number of half-cycles."""
    taken = half_cycles(problem)
    for run, count in enumerate(taken):
        possible = [(c[run], p) for c, p in others if c[run] != count and p > thresholds.POSSIBLE]
        if possible:
            counts = " and ".join(str(each) for each, _ in possible)
            odds = " and ".join(f"{p:.2g}" for _, p in possible)
            have = "have probabilities" if len(possible) > 1 else "have a probability"
            yield (
                f"The record leaves the number of half-cycles{of_run(run, problem)} uncertain: {count} were assumed, "
                f"and {counts} {have} of {odds}. The standard errors include them."
            )


def _on_drift(problem: Problem, misfit: Misfit) -> Iterator[str]:
    window = problem.windows[misfit.run]
    unit, speed = window.quantity, window.segmentation.drift
    far = abs(speed) * float(np.ptp(np.asarray(window.trace.t)[window.used]))
    if far > thresholds.NOTICED * misfit.noise and "drift" not in window.nuisances:
        yield (
            f"The record drifts at rest by {engineering(speed, f'{unit}/s')}, over the fitted window by "
            f"{engineering(far, unit)}: free that too, nuisance={[*window.nuisances, 'drift']}."
        )


def _on_growth(problem: Problem) -> Iterator[str]:
    for i, window in enumerate(problem.windows):
        grown = growth(window)
        if grown is not None:
            first, last = (engineering(path, window.quantity) for path in grown)
            yield (
                f"The amplitude{of_run(i, problem)} grows with time, from half-cycles of {first} to {last}. No free "
                "decay does this: is the time reversed, or is the mass driven?"
            )


def _on_the_model(problem: Problem, values: Mapping[str, float]) -> Iterator[str]:
    rigid = [p.name for p in problem.parameters if values[p.name] >= _RIGID * p.rigid]
    if rigid:
        yield (
            f"The record is consistent with a rigid contact ({', '.join(rigid)} -> infinity). Use a law without it, "
            "such as Coulomb, which has fewer coefficients."
        )
    if not {"mass", "stiffness"} & {parameter.kind for parameter in problem.parameters}:
        yield (
            "The natural frequency is fixed, although the trace determines it far better than any calibration. Free "
            "the stiffness."
        )


def _on_the_errors(numerical_shift: float) -> Iterator[str]:
    if numerical_shift > thresholds.ACCURATE:
        yield (
            f"The numerical error of the computed motion may move a parameter by {numerical_shift:.2g} standard "
            "errors. Ask the engine for more accuracy, or choose another engine."
        )


def _on_the_rest(
    problem: Problem, margins: tuple[Margin | None, ...], excesses: tuple[float | None, ...]
) -> Iterator[str]:
    """Yield warnings if the law stops the mass elsewhere than the record."""
    unit = problem.windows[0].quantity
    for i, margin in enumerate(margins):
        if margin is not None and min(margin) < -thresholds.NOTICED * problem.windows[i].stated:
            yield (
                f"The law would stop the mass{of_run(i, problem)} after another number of half-cycles than the record "
                f"shows (margins {margin.one_more:.2e}, {margin.one_less:.2e} {unit}). Check static friction and the "
                "model."
            )
    for i, excess in enumerate(excesses):
        if excess is not None and excess < -thresholds.NOTICED * problem.windows[i].stated:
            yield (
                f"The law would stop the mass{of_run(i, problem)} inside the record, which shows it moving to the "
                f"end: at a reversal the deflection is {-excess:.2e} {unit} too small to overcome static friction. "
                "Check static friction and the model."
            )


def _on_static_friction(bracket: Bracket | None) -> Iterator[str]:
    if bracket is not None and bracket.contradicted:
        low, high = plain(bracket.lower, 4), plain(bracket.upper, 4)
        yield (
            "No static coefficient agrees with all stops: the dynamic coefficient and the stops require at least "
            f"{high}, but the mass moved on where it must be below {low}. Static friction differs from stop to stop, "
            "or a stop was misread. The oscillator does not contain a static coefficient from these stops."
        )


def implausible(problem: Problem, values: Mapping[str, float]) -> Iterator[str]:
    """Yield a warning for each implausible value, and doubts about a record."""
    for window in problem.windows:
        yield from window.doubts
    for parameter in problem.parameters:
        if too_large(problem, parameter, values[parameter.name]):
            yield (
                f"{parameter.name} = {values[parameter.name]:.3g} is larger than any coefficient of friction: "
                "check the units of the displacement and of the normal force."
            )
    angular = problem.windows[0].quantity == "rad" or isinstance(problem.residual.oscillator.restoring, Pendulum)
    for i, window in enumerate(problem.windows):
        interval = float(np.median(np.diff(np.asarray(window.trace.t))))
        yield from implausible_scale(window.segmentation, interval, angular=angular, where=of_run(i, problem))
