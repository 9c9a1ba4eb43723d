"""Uncertainty budgets of routes other than the fit of a trace.

A route is evaluated again with each input of the rig larger and smaller by its standard uncertainty, which gives its
sensitivity (JCGM 100, 5.1.3). The scatter of the readings is the standard error of the route.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ..data import Record, Trace
from ..errors import UsageError, nearest
from ..rig import Rig
from ..rig.quantity import UNITS
from .fitted import by_powers
from .inputs import Input
from .propagation import Correlations, derived
from .result import Budget

SCATTER_OF_READINGS = "scatter of the readings"
SCALE = "displacement_scale"


def route_budget(
    route: Callable[..., Any], rig: Rig, *readings: Any, name: str = "mu", correlations: Correlations | None = None
) -> Budget:
    """Return the uncertainty budget of a coefficient from a route.

    Args:
        route: takes the readings and then the rig, and returns a result with `values` and `std_errors` by name:
            `fricjax.fit_triangle_map`, ``lambda x0, xf, rig: fj.fit_final_displacements(x0, xf, rig.oscillator(law))``,
            or ``lambda run, rig: fj.fit_force_map(fj.friction_force_map(run, rig), law)`` of a record.
        rig: the rig with its uncertain inputs.
        *readings: arguments of the route before the rig: arrays of displacements, or records.
        name: name of the coefficient.
        correlations: correlation coefficient of each pair of inputs that are not independent.

    Returns:
        The budget, in SI units.

    Raises:
        UsageError: the route does not return the coefficient, or has not determined it.

    Examples:
        >>> import fricjax as fj
        >>> rig = fj.Rig(mass=0.4, stiffness="2500 +/- 25", damping=0.0, normal_force="10 +/- 0.05")
        >>> pairs = [1.1e-3, 1.5e-3, 2.1e-3, 2.5e-3], [1.02e-4, -1e-4, -1.01e-4, 1e-4]
        >>> budget = fj.uncertainty.route_budget(fj.fit_triangle_map, rig, *pairs)
        >>> sorted(budget.inputs), round(budget.std / budget.value, 3)
        (['normal_force', 'scatter of the readings', 'stiffness'], 0.011)
    """
    result = route(*readings, rig)
    if name not in result.std_errors:
        known = result.std_errors
        raise UsageError(f"This route gives no {name!r}.{nearest(name, known)} It gives {', '.join(known)}.")
    value, noise, unit = float(result.values[name]), float(result.std_errors[name]), result.units[name]
    if not (np.isfinite(value) and np.isfinite(noise)):
        raise UsageError(f"{name} has no budget, because this route has not determined it from these readings.")
    slopes: dict[str, float] = {}
    centres: dict[str, float] = {}
    rows: dict[str, Any] = {
        SCATTER_OF_READINGS: Input(0.0, noise, unit, degrees_of_freedom=max(getattr(result, "dof", 1), 1), kind="A")
    }
    for source, number in rig.inputs().items():
        ends = [_value(route, rig, readings, name, source, number.value + sign * number.std) for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * number.std)
        if slope:
            slopes[source], centres[source] = slope, number.value
            rows[source] = Input(number.value, number.std, UNITS[source])
    formula = by_powers(value, slopes, centres, (SCATTER_OF_READINGS,))
    notes = () if slopes else ("No uncertain input of the rig is counted: give them with their uncertainties.",)
    return derived(formula, rows, quantity=name, unit=unit, correlations=correlations, notes=notes)


def _value(
    route: Callable[..., Any], rig: Rig, readings: tuple[Any, ...], name: str, source: str, value: float
) -> float:
    """Return the coefficient with one input of the rig changed."""
    if source == SCALE:
        readings = tuple(_scaled(each, value) for each in readings)
    else:
        rig = rig.with_inputs({source: value})
    return float(route(*readings, rig).values[name])


def _scaled(reading: Any, factor: float) -> Any:
    """Multiply the displacements of a reading by a factor."""
    if isinstance(reading, Record):
        trace = reading.trace
        sigma = None if trace.sigma is None else trace.sigma * factor
        return dataclasses.replace(reading, trace=Trace(trace.t, trace.x * factor, sigma=sigma, mask=trace.mask))
    return np.asarray(reading, float) * factor
