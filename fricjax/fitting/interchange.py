"""Exchange fits with pandas, xarray, uncertainties and lmfit.

These packages are imported only when needed. Values are in SI units; units are kept if the other package can store
them.
"""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from ..errors import UsageError, brief, needed
from ..oscillator import Oscillator
from ..oscillator.oscillator import leaves_of
from ..show.tables import Variable, dataset
from .names import NUISANCES, of_run

type Bounds = tuple[float | None, float | None]


class Asked(NamedTuple):
    """Machine, free coefficients, start values and bounds from lmfit Parameters."""

    oscillator: Oscillator
    free: tuple[str, ...]
    guess: dict[str, float]
    bounds: dict[str, Bounds]


_FACTS = ("status", "converged", "described", "chi2", "dof", "sigma", "engine", "warnings")


def plain_name(name: str) -> str:
    """Return a name that is a valid Python identifier.

    Examples:
        >>> from fricjax.fitting.interchange import plain_name
        >>> plain_name("friction.0.mu"), plain_name("x0[2]")
        ('friction_0_mu', 'x0_2')
    """
    return re.sub(r"\W+", "_", name).strip("_")


def is_lmfit(free: Any) -> bool:
    """Return True if `free` is an lmfit Parameters object."""
    return isinstance(free, Mapping) and hasattr(free, "valuesdict")


def from_lmfit(parameters: Any, oscillator: Oscillator) -> Asked:
    """Translate lmfit Parameters into machine, free names, guess and bounds.

    Parameters that vary are free, with their values as start values and their bounds. Fixed ones are set in the
    machine. Parameters of a run (x0, offset, ...) only set start values and bounds; `start` and `nuisance` of the fit
    select them.

    Raises:
        UsageError: a name that the machine does not have, an expression, or a parameter of a run that is fixed.
    """
    leaves = {plain_name(name): leaf for leaf in leaves_of(oscillator) for name in (leaf.dotted, leaf.name)}
    flat, structure = jax.tree.flatten(oscillator)
    free, guess, bounds = [], {}, {}
    for name, parameter in parameters.items():
        nuisance, leaf = re.sub(r"_\d+$", "", name) in NUISANCES, leaves.get(name)
        if parameter.expr:
            raise UsageError(f"{name} follows the expression {parameter.expr!r}: write it as tie= of the fit instead.")
        if leaf is None and not nuisance:
            raise UsageError(f"This oscillator has no coefficient {name!r}. It has {', '.join(leaves)}.")
        if nuisance and not parameter.vary:
            raise UsageError(f"{name} belongs to the run and cannot be fixed: leave it out of nuisance= instead.")
        called = re.sub(r"_(\d+)$", r"[\1]", name) if leaf is None else leaf.name
        if leaf is not None and not parameter.vary:
            # JAX would differentiate a Python number, and treat a drag of zero as a drag.
            flat[leaf.index] = np.asarray(float(parameter.value))
            continue
        free += [] if leaf is None else [called]
        guess |= {called: float(parameter.value)} if math.isfinite(parameter.value) else {}
        ends = tuple(None if math.isinf(end) else float(end) for end in (parameter.min, parameter.max))
        bounds |= {called: ends} if ends != (None, None) else {}
    return Asked(jax.tree.unflatten(structure, flat), tuple(free), guess, bounds)


def to_lmfit(fit: Any) -> Any:
    """Convert a fit to lmfit Parameters.

    They contain values, standard errors, correlations and bounds, and the other coefficients of the machine as fixed.
    """
    lmfit = needed("A fit as Parameters", "lmfit", "interchange")
    parameters = lmfit.Parameters()
    known = {} if fit.problem is None else {each.name: each for each in fit.problem.parameters}
    for name in fit.names:
        each, shared = known.get(name), not of_run(name)
        low, high = (each.lower, each.upper) if each is not None and shared else (-math.inf, math.inf)
        parameters.add(plain_name(name), fit.values[name], min=low, max=high)
    for leaf, value in zip(leaves_of(fit.oscillator), jax.tree.leaves(fit.oscillator), strict=True):
        if plain_name(leaf.name) not in parameters and np.ndim(value) == 0:
            parameters.add(plain_name(leaf.name), float(value), vary=False)
    correlation = fit.correlation
    for i, name in enumerate(fit.names):
        parameter, std = parameters[plain_name(name)], fit.std_errors[name]
        parameter.stderr = std if np.isfinite(std) else None
        others = [(plain_name(other), correlation[i, j]) for j, other in enumerate(fit.names) if j != i]
        parameter.correl = {other: float(value) for other, value in others if np.isfinite(value)}
    return parameters


def to_uncertainties(fit: Any) -> dict[str, Any]:
    """Convert values to numbers of the package uncertainties.

    They are correlated by the combined covariance.
    """
    package = needed("A number with correlated errors", "uncertainties", "interchange")
    determined = [i for i, name in enumerate(fit.names) if np.isfinite(fit.combined_std_errors[name])]
    values = [fit.values[fit.names[i]] for i in determined]
    numbers = package.correlated_values(values, fit.combined_covariance[np.ix_(determined, determined)])
    known = {fit.names[i]: number for i, number in zip(determined, numbers, strict=True)}
    return {name: known.get(name, package.ufloat(fit.values[name], math.nan)) for name in fit.names}


def to_dataframe(fit: Any) -> Any:
    """Return one row for each parameter and kinematic quantity."""
    import pandas as pd

    columns = ["value", "std", "combined_std", "low", "high", "unit", "remarks"]
    rows = {}
    for name, value in fit.values.items():
        low, high = fit.intervals.get(name, (math.nan, math.nan))
        std, combined = (of.get(name, math.nan) for of in (fit.std_errors, fit.combined_std_errors))
        rows[name] = [value, std, combined, low, high, fit.units[name], "; ".join(fit.flags.get(name, ()))]
    for name, number in fit.kinematics.items():
        rows[name] = [number.value, math.nan, number.std, math.nan, math.nan, number.unit, "kinematics"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")


def to_xarray(fit: Any) -> Any:
    """Return values, covariances and samples as an xarray data set.

    Each run has its samples, the model and the residuals.
    """
    square, names = ("parameter", "parameter_2"), list(fit.names)
    by_name = {"value": fit.values, "std": fit.std_errors, "combined_std": fit.combined_std_errors}
    variables = {key: Variable("parameter", [of[name] for name in names]) for key, of in by_name.items()}
    variables |= {key: Variable(square, getattr(fit, key)) for key in ("covariance", "combined_covariance")}
    coordinates = {axis: Variable(axis, names) for axis in square}
    coordinates["unit"] = Variable("parameter", [fit.units[name] for name in names])
    for i, (t, run, residual) in enumerate(zip(fit.times, fit.runs, fit.residuals_by_run, strict=True)):
        end = "" if len(fit.runs) == 1 else f"_{i}"
        x = np.asarray(run.x)
        coordinates[f"t{end}"] = Variable(f"t{end}", t, "s", "time")
        samples = {"x": (x, "measured"), "model": (x - residual, "computed"), "residual": (residual, "difference")}
        variables |= {f"{key}{end}": Variable(f"t{end}", values, fit.quantity, f"{what} {fit.observation.name.lower()}")
                      for key, (values, what) in samples.items()}  # fmt: skip
    law = type(fit.oscillator.friction).__name__
    facts = {name: getattr(fit, name) for name in _FACTS}
    return dataset(variables, coordinates, **facts, friction=law, sources=fit.labels)


def batch_to_xarray(batch: Any) -> Any:
    """Return the results of all runs as an xarray data set."""
    names, derived = list(batch.names), list(batch.kinematics)
    both, square = ("run", "parameter"), ("run", "parameter", "parameter_2")
    rows = lambda of, of_names: np.stack([of[name] for name in of_names], axis=1)
    variables = {
        "value": Variable(both, rows(batch.values, names)),
        "std": Variable(both, rows(batch.std_errors, names)),
        "combined_std": Variable(both, rows(batch.combined_std_errors, names)),
        "covariance": Variable(square, batch.covariance),
        "kinematics": Variable(("run", "quantity"), rows(batch.kinematics, derived)),
        "kinematics_std": Variable(("run", "quantity"), rows(batch.kinematics_std, derived)),
        **{name: Variable("run", getattr(batch, name)) for name in ("chi2", "dof", "residual_rms", "half_cycles")},
        **{name: Variable("run", getattr(batch, name)) for name in ("converged", "described")},
        "status": Variable("run", list(batch.status)),
    }
    coordinates = {axis: Variable(axis, names) for axis in square[1:]}
    coordinates |= {"quantity": Variable("quantity", derived), "source": Variable("run", list(batch.sources))}
    coordinates["unit"] = Variable("parameter", [batch.units[name] for name in names])
    return dataset(variables, coordinates, engine=batch.engine)


def asked_of(free: Any, oscillator: Oscillator, settings: Mapping[str, Any]) -> tuple[Oscillator, Any, dict[str, Any]]:
    """Return machine, free names and settings, after conversion from lmfit Parameters.

    Explicit settings take precedence over those in the Parameters.
    """
    if isinstance(free, Oscillator) or not isinstance(free, Iterable):
        raise UsageError(
            "free= takes the names of the parameters to fit, such as ['mu', 'damping', 'stiffness'], "
            f"got {brief(free)}."
        )
    if not is_lmfit(free):
        return oscillator, free, dict(settings)
    asked = from_lmfit(free, oscillator)
    tables = {name: {**getattr(asked, name), **(settings.get(name) or {})} for name in ("guess", "bounds")}
    return asked.oscillator, asked.free, {**settings, **tables}
