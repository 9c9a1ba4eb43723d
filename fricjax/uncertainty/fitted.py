"""Uncertainty budgets of fitted values.

A budget has the noise of the record, the scatter from run to run, and the inputs of the rig. The normal equations at
the optimum give its derivative with respect to each input, without another fit. The budget extends this derivative to
a power law of the input, ``y (x/x_0)^e``, if both numbers differ from zero, and to a straight line otherwise. Mass,
stiffness, load and the coefficients of a fit have a common scale that a record does not determine. A value such as
``mu = omega^2 x_d m/N`` is a product of powers, so the power law is exact for it.
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
    """Return the uncertainty budget of a fitted value.

    Args:
        fit: a fit made with `rig`; it has the derivatives of its values with respect to each uncertain input.
        rig: the rig with the uncertainties to propagate; None: the rig of the fit.
        name: a free parameter or one of the kinematics; None: mu, or the first parameter.
        inputs: more detailed descriptions of inputs of the rig, by name: an `Input` with a distribution or degrees of
            freedom, or a `Budget` of a formula, which is replaced by its inputs. If a value differs from that of the
            fit, the result changes accordingly.
        scatter: scatter from run to run: the `Population` of a batch, with a mean and standard error that replace the
            value and the noise of this fit, or an `Input` of value zero to add.
        correlations: correlation coefficient of each pair of inputs that are not independent.

    Returns:
        The budget, in SI units.

    Raises:
        UsageError: the fit has not determined the name, or has no such input.

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
    """Return a formula with powers of the inputs.

    Args:
        value: the value at `centres`.
        slopes: derivative of the value with respect to each input, by name.
        centres: value of each input; an input of zero enters linearly.
        added: names of inputs to add to the result.
    """
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
    """Return a fitted quantity with its standard error from noise."""
    known = {**fit.std_errors, **fit.kinematics}
    if name not in known:
        raise UsageError(f"This fit has no {name!r}.{nearest(name, known)} It has {', '.join(known)}.")
    if name in fit.std_errors:
        fitted = Measured(fit.values[name], fit.std_errors[name], fit.units[name])
    else:
        combined = fit.kinematics[name]
        # If the rig dominates, this difference has rounding errors, but too small for a digit of the budget.
        square = combined.std**2 - sum(part**2 for part in fit.contributions[name].values())
        fitted = dataclasses.replace(combined, std=math.sqrt(max(square, 0.0)))
    if not fitted.is_finite:
        raise UsageError(f"{name} has no budget, because this fit has not determined it: {fit.status}")
    return fitted


def inputs_of(fit: Fit, rig: Rig | None) -> dict[str, Input]:
    """Return the uncertain inputs of a rig, by name in the fit.

    Args:
        fit: the fit.
        rig: the rig; None: the rig of the fit.

    Raises:
        UsageError: the fit does not have an input of the rig.
    """
    stated = fit.inputs if rig is None else rig.inputs()
    known: dict[str, Input] = {}
    for name, each in stated.items():
        # A periodic error of unknown phase is two inputs, sine and cosine.
        parts = [key for key in fit.inputs if key == name or key.removesuffix("_sine").removesuffix("_cosine") == name]
        if not parts:
            raise UsageError(
                f"This fit does not know how its values follow {name}: in its rig that input was exact or missing. Fit "
                "again with rig=."
            )
        known |= {part: Input(each.value, each.std, _unit(fit, name)) for part in parts}
    exact = {name: Input(each.value, 0.0, _unit(fit, name)) for name, each in fit.inputs.items() if name not in known}
    return known | exact


def _unit(fit: Fit, name: str) -> str:
    stem = name.removesuffix("_sine").removesuffix("_cosine")
    return rotary_unit(UNITS[stem], fit.observation.motion)


def _stated(fit: Fit, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Convert given inputs by name.

    Raises:
        UsageError: the fit does not have such an input.
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
