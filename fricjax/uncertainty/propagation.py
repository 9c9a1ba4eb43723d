"""Uncertainty budgets of formulas, with exact derivatives.

An input of a formula may be the budget of another formula.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import UsageError, nearest
from ..oscillator import ready
from .inputs import Input
from .result import Budget

type Correlations = Mapping[tuple[str, str], float]


def propagate(
    formula: Callable[..., Any],
    inputs: Mapping[str, Any],
    *,
    quantity: str = "result",
    unit: str = "",
    correlations: Correlations | None = None,
) -> Budget:
    """Return the uncertainty budget of a formula.

    Args:
        formula: takes the inputs by name, each one number, and returns one number. JAX differentiates it, so write it
            with arithmetic and `jax.numpy`.
        inputs: by name, each an `Input`, a `Measured`, a number, a text such as ``"9.66 +/- 0.05"``, or a `Budget`,
            which is replaced by its inputs.
        quantity: name of the result.
        unit: its unit.
        correlations: correlation coefficient of each pair of inputs that are not independent.

    Returns:
        The budget: value, sensitivities, contributions.

    Raises:
        UsageError: an input is not a number, a correlation is impossible, or JAX cannot differentiate the formula.

    Examples:
        >>> from fricjax.uncertainty import Input, propagate
        >>> density = Input.rectangular(1.20, 0.02, "kg/m^3")
        >>> weight = {"mass": Input(0.98, 2e-5, "kg"), "gravity": Input(9.8107, 1e-4, "m/s^2"), "air": density}
        >>> load = propagate(lambda mass, gravity, air: mass * gravity * (1 - air / 7900), weight, quantity="load")
        >>> pull = {"load": load, "arcuate": Input.rectangular(1.0, 1e-3)}
        >>> force = propagate(lambda load, arcuate: load * arcuate, pull, quantity="normal force", unit="N")
        >>> print(force, list(force.inputs))
        Budget(normal force = 9.6130(56) N, 4 inputs) ['mass', 'gravity', 'air', 'arcuate']
    """
    ready()
    return derived(lambda values: formula(**values), inputs, quantity=quantity, unit=unit, correlations=correlations)


def derived(
    formula: Callable[[Mapping[str, Any]], Any],
    inputs: Mapping[str, Any],
    *,
    quantity: str,
    unit: str,
    correlations: Correlations | None,
    notes: tuple[str, ...] = (),
) -> Budget:
    """Return the budget of a formula with a mapping as argument.

    Budgets among the inputs are replaced by their inputs.
    """
    import jax
    import jax.numpy as jnp

    nested = {name: each for name, each in inputs.items() if isinstance(each, Budget)}
    flat: dict[str, Input] = {}
    for name, each in inputs.items():
        parts = each.inputs if isinstance(each, Budget) else {name: Input.of(each)}
        for part, value in parts.items():
            if flat.setdefault(part, value) != value:
                raise UsageError(f"Two inputs are named {part} and differ. Give one of them another name.")

    def composed(values: Mapping[str, Any]) -> Any:
        return formula({name: nested[name].formula(values) if name in nested else values[name] for name in inputs})

    at = {name: jnp.asarray(each.value, float) for name, each in flat.items()}
    try:
        value, slopes = jax.jit(jax.value_and_grad(composed))(at)
    except (jax.errors.JAXTypeError, TypeError) as error:
        raise UsageError(
            f"The formula of {quantity} cannot be differentiated: {str(error).splitlines()[0]} Write a function of the "
            "inputs by name that returns one number, with arithmetic and jax.numpy."
        ) from error
    if not all(np.isfinite(float(each)) for each in (value, *slopes.values())):
        raise UsageError(f"The formula of {quantity} or its derivative is not finite at the values of the inputs.")
    matrix = _correlation(flat, correlations or {}, nested)
    sensitivities = {name: float(slope) for name, slope in slopes.items()}
    return Budget(quantity, unit, float(value), flat, sensitivities, matrix, composed, notes)


def _correlation(inputs: Mapping[str, Input], pairs: Correlations, nested: Mapping[str, Budget]) -> np.ndarray:
    """Return the correlation matrix of the inputs and of nested budgets.

    Raises:
        UsageError: a name is unknown, a coefficient is beyond one, or the coefficients contradict one another.
    """
    names = list(inputs)
    matrix = np.eye(len(names))
    for each in nested.values():
        places = [names.index(name) for name in each.inputs]
        matrix[np.ix_(places, places)] = each.correlation
    for (a, b), coefficient in pairs.items():
        for name in (a, b):
            if name not in inputs:
                raise UsageError(f"There is no input {name!r} to correlate.{nearest(name, names)}")
        if a == b or not -1 <= coefficient <= 1:
            raise UsageError(f"The correlation of {a} and {b} must be between -1 and 1, got {coefficient:g}.")
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = coefficient
    # Rounding may make an eigenvalue of a singular matrix negative.
    if np.linalg.eigvalsh(matrix)[0] < -1e-12 * len(names):
        raise UsageError("The correlations of the inputs contradict one another: no errors have all of them at once.")
    return matrix
