"""The uncertainty budget of a fitted value: the noise of its record, the scatter of its runs, each input of the rig.

How an optimum moves with an input is known from the normal equations there, without fitting again. That motion is
taken as a power of the input, ``y (x/x_0)^e``, where both have a size: mass, stiffness, load and the coefficients of a
fit have a common scale that no record shows, so that ``mu = omega^2 x_d m/N`` is such a product, for which the power
law is exact. Whatever has the value zero enters in proportion.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

from ..errors import UsageError, nearest
from ..fitting import Fit
from ..fitting.population import Population
from ..rig import Measured, Rig
from ..rig.quantity import UNITS
from ..show import rotary_unit
from .inputs import Input
from .propagation import Correlations, derived
from .result import Budget

NOISE = "noise of the record"
SCATTER = "scatter from run to run"


def budget(
    fit: Fit,
    rig: Rig | None = None,
    name: str | None = None,
    *,
    inputs: Mapping[str, Any] | None = None,
    scatter: Population | Input | None = None,
    correlations: Correlations | None = None,
) -> Budget:
    """The uncertainty budget of a fitted value.

    Args:
        fit: a fit that was made with `rig`, so that it knows how its values follow each uncertain input.
        rig: the rig with the uncertainties to count; None: those of the fit's own.
        name: a free parameter or one of the kinematics; None: mu, or the first parameter.
        inputs: what is known better of an input of the rig than its `Measured` tells, by its name: an `Input` with a
            distribution or degrees of freedom, or a `Budget` of a formula, whose inputs then stand in its place. Where
            its value differs from that of the fit, the result moves with it.
        scatter: from run to run: the `Population` of a batch, whose mean and standard error take the place of the value
            and the noise of this one fit, or an `Input` of value zero that is added to it.
        correlations: coefficient of correlation of each pair of inputs that are not independent.

    Returns:
        The budget, in SI units.

    Raises:
        UsageError: a name that the fit has not determined, or an input that it does not know.

    Examples:
        >>> import fricjax as fj
        >>> rig = fj.Rig(mass="0.4 +/- 0.001", stiffness=2500.0, normal_force="10 +/- 0.1", damping=0.2)
        >>> machine = rig.oscillator(fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"], rig=rig)
        >>> budget = fj.uncertainty.budget(fit)
        >>> budget, {name: round(100 * share) for name, share in budget.shares.items()}
        (Budget(mu = 0.05000(52), 3 inputs), {'noise of the record': 0, 'mass': 6, 'normal_force': 94})
    """
    name = name or ("mu" if "mu" in fit.names else fit.names[0])
    fitted = _fitted(fit, name)
    value, noise, unit = fitted.value, fitted.std, fitted.unit or ""
    slopes = {key: moved / fit.inputs[key].std for key, moved in fit.contributions[name].items()}
    known = {**fit.inputs, **inputs_of(fit, rig), **_stated(fit, inputs or {})}
    centres = {key: fit.inputs[key].value for key in slopes}
    rows: dict[str, Any] = {NOISE: Input(0.0, noise, unit, degrees_of_freedom=max(fit.dof, 1), kind="A")}
    if isinstance(scatter, Population):
        value, freedom = scatter.mean, scatter.runs - 1
        rows = {SCATTER: Input(0.0, scatter.std, unit, degrees_of_freedom=freedom, kind="A")}
    elif scatter is not None:
        rows[SCATTER] = scatter
    added = tuple(rows)
    formula = by_powers(value, slopes, centres, added)
    rows |= {key: known[key] for key in slopes}
    notes = ("No uncertain input of the rig is counted: fit with rig=.",) if not slopes else ()
    return derived(formula, rows, quantity=name, unit=unit, correlations=correlations, notes=notes)


def by_powers(
    value: float, slopes: Mapping[str, float], centres: Mapping[str, float], added: tuple[str, ...]
) -> Callable[[Mapping[str, Any]], Any]:
    """A value as a function of its inputs: powers of those with a size, with these slopes, and what is added."""
    powers = {key: slope * centres[key] / value for key, slope in slopes.items() if centres[key] and value}

    def formula(values: Mapping[str, Any]) -> Any:
        result = value
        for key, power in powers.items():
            result = result * (values[key] / centres[key]) ** power
        for key in slopes.keys() - powers.keys():
            result = result + slopes[key] * (values[key] - centres[key])
        return result + sum(values[key] for key in added)

    return formula


def _fitted(fit: Fit, name: str) -> Measured:
    """A fitted quantity with its standard error by the noise alone."""
    known = {**fit.std_errors, **fit.kinematics}
    if name not in known:
        raise UsageError(f"This fit has no {name!r}.{nearest(name, known)} It has {', '.join(known)}.")
    if name in fit.std_errors:
        fitted = Measured(fit.values[name], fit.std_errors[name], fit.units[name])
    else:
        combined = fit.kinematics[name]
        # Where the rig decides, what it leaves of the noise is rounding, of a share that no table shows.
        square = combined.std**2 - sum(part**2 for part in fit.contributions[name].values())
        fitted = dataclasses.replace(combined, std=math.sqrt(max(square, 0.0)))
    if not fitted.is_finite:
        raise UsageError(f"{name} has no budget, for this fit has not determined it: {fit.status}")
    return fitted


def inputs_of(fit: Fit, rig: Rig | None) -> dict[str, Input]:
    """The uncertain inputs of a rig, or of that of the fit, by the names that the fit has for them.

    Raises:
        UsageError: an input of the rig that the fit does not know.
    """
    stated = fit.inputs if rig is None else rig.inputs()
    known: dict[str, Input] = {}
    for name, each in stated.items():
        # A periodic error is two inputs, for its phase is not known.
        parts = [key for key in fit.inputs if key == name or key.removesuffix("_sine").removesuffix("_cosine") == name]
        if not parts:
            raise UsageError(
                f"This fit does not know how its values follow {name}: it was made without a rig in which that is "
                "uncertain. Fit again with rig=."
            )
        known |= {part: Input(each.value, each.std, _unit(fit, name)) for part in parts}
    exact = {name: Input(each.value, 0.0, _unit(fit, name)) for name, each in fit.inputs.items() if name not in known}
    return known | exact


def _unit(fit: Fit, name: str) -> str:
    stem = name.removesuffix("_sine").removesuffix("_cosine")
    return rotary_unit(UNITS[stem], fit.quantity)


def _stated(fit: Fit, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Inputs by name, each known to the fit.

    Raises:
        UsageError: one that is not.
    """
    for name in inputs:
        if name not in fit.inputs:
            raise UsageError(
                f"{name!r} is no uncertain input of this fit.{nearest(name, fit.inputs)} "
                f"It has {', '.join(fit.inputs) or 'none: fit with rig='}."
            )
    return {
        name: each if isinstance(each, Budget) else Input.of(each, _unit(fit, name)) for name, each in inputs.items()
    }
