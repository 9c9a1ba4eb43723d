"""Route 2: coefficients from initial and final displacements, without a trace.

With the numbers of half-cycles as data the final displacement is a smooth, nearly linear function of the dynamic
coefficient. The static coefficient has no gradient there; it lies between the turning points at which the mass stopped
and those at which it moved on.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import DataError, UsageError
from ..estimation.space import Parameter, ParameterSpace
from ..fitting.names import check_identifiable, find_leaf, sole_coulomb
from ..oscillator import Oscillator, ready
from ..oscillator.leaves import leaves_of
from ..oscillator.select import select_engine
from .displacements import Pairs, checked_pairs
from .pair_model import PairModel, fitted_dead_band, predicted, solve_pairs
from .pair_remarks import remarks, status_of_counts
from .result import RouteFit
from .settings import check_scatter
from .solve import Solution, flags_of, status_of
from .static import Bracket, bracket
from .unwrapping import Unwrapped, capacity_for, counted, decay_ratio


def fit_final_displacements(
    x0: Any,
    xf: Any,
    oscillator: Oscillator,
    free: Sequence[str] = ("mu",),
    *,
    nuisance: Sequence[str] = ("offset",),
    half_cycles: Any = None,
    sigma: Any = None,
    mu_scatter: float = 0.0,
) -> RouteFit:
    """Fit coefficients to pairs of initial and final displacement.

    Args:
        x0: initial displacements in the reading of the instrument [m], shape (pairs,), of any sign and in any order.
            Those of a slow release are biased; :func:`pairs_of` takes the first reversal instead.
        xf: final displacements [m], shape (pairs,).
        oscillator: the machine; its coefficients that are not free are taken as exact. Its static coefficient is never
            used.
        free: names of the coefficients to fit; "mu_s" asks for the bracket of the static coefficient.
        nuisance: "offset" where the equilibrium of the instrument is not known; it then needs runs of different
            numbers of half-cycles or of both signs.
        half_cycles: number of half-cycles of each pair, shape (pairs,); None: found from the pairs, for a law that is
            nearly Coulomb's.
        sigma: standard deviation of each final displacement [m], one number or shape (pairs,); None: from the scatter.
        mu_scatter: relative standard deviation of mu from run to run, which scatters a final displacement in
            proportion to its number of half-cycles.

    Returns:
        The fit; in Coulomb laws ``intervals["mu_s"]`` is the bracket of the static coefficient and ``values["mu_s"]``
        its middle, the upper end infinite where no reversal passed it.

    Raises:
        UsageError: names or arrays that do not fit.
        DataError: pairs that are not finite, or from which nothing can be determined.
        RuntimeError: JAX computes in single precision.
    """
    ready()
    pairs = checked_pairs(x0, xf, half_cycles, sigma)
    names = [name for name in free if not _bracketed(name, oscillator)]
    _check(names, nuisance, mu_scatter)
    found = _counted(pairs, oscillator, "offset" in nuisance)
    _check_motion(found, pairs, len(names) + len(nuisance))
    model, parameters = _model(pairs, oscillator, names, tuple(nuisance), found)
    weight = _sigma(pairs, found, mu_scatter)
    scaled = pairs.sigma is None and mu_scatter == 0
    model, solution = solve_pairs(pairs, model, weight, len(parameters), scaled)
    found = found._replace(half_cycles=np.asarray(model.half_cycles))
    return _assembled(pairs, model, parameters, solution, found, weight, scaled)


def _bracketed(name: str, oscillator: Oscillator) -> bool:
    return name.rsplit(".", 1)[-1] == "mu_s" and sole_coulomb(oscillator.friction) is not None


def _check(names: Sequence[str], nuisance: Sequence[str], mu_scatter: float) -> None:
    if not names:
        raise UsageError(
            "mu_s alone cannot be fitted: it is bracketed by the reversals that a fitted mu gives. Free mu as well."
        )
    unknown = [name for name in nuisance if name != "offset"]
    if unknown:
        raise UsageError(f"Pairs have no nuisance parameter {unknown[0]!r}; the only one is 'offset'.")
    check_scatter(mu_scatter)


def _counted(pairs: Pairs, oscillator: Oscillator, offset_free: bool) -> Unwrapped:
    """Numbers of half-cycles, and the dead band and offset that start the fit."""
    free_offset = offset_free and pairs.x0.size > 1
    rho = decay_ratio(oscillator)
    return counted(pairs.x0, pairs.xf, pairs.half_cycles, rho, None if free_offset else 0.0)


def _check_motion(found: Unwrapped, pairs: Pairs, parameters: int) -> None:
    if not np.any(found.half_cycles > 0):
        raise DataError(
            "In none of the pairs did the mass complete a half-cycle: the initial displacements lie in the dead band, "
            "which gives only a lower bound of the static coefficient. Release from farther away."
        )
    distinct = np.unique(np.stack([pairs.x0, pairs.xf]), axis=1).shape[1]
    if distinct < parameters:
        raise DataError(
            f"{distinct} different pair(s) cannot determine {parameters} parameters. Record more runs from different "
            "initial displacements."
        )


def _model(
    pairs: Pairs, oscillator: Oscillator, names: Sequence[str], nuisance: tuple[str, ...], found: Unwrapped
) -> tuple[PairModel, tuple[Parameter, ...]]:
    leaves = leaves_of(oscillator)
    chosen = [find_leaf(name, leaves) for name in names]
    check_identifiable([leaf.name for leaf in chosen], leaves)
    flat = [float(value) for value in jax.tree.leaves(oscillator)]
    starts = [_start(leaf.name, flat[leaf.index], oscillator, found) for leaf in chosen]
    entries = [
        Parameter(leaf.name, leaf.unit, s, abs(s) or 1.0, fitted_as=leaf.coefficient.fitted_as)
        for leaf, s in zip(chosen, starts, strict=True)
    ]
    entries += [Parameter(name, "m", found.offset, found.dead_band) for name in nuisance]
    space = ParameterSpace.build(entries, [leaf.index for leaf in chosen], [], [nuisance])
    engine = select_engine("auto", oscillator, max_half_cycles=capacity_for(found.half_cycles))
    if not oscillator.friction.set_valued:
        raise UsageError(
            f"Under {type(oscillator.friction).__name__} the mass does not rest where a stroke ends. Use a law that "
            "holds the mass and has no internal states, such as Coulomb or Stribeck."
        )
    machine = jax.tree.map(lambda leaf: np.asarray(leaf, float), oscillator)
    offset = np.asarray(found.offset)
    return PairModel(machine, space, engine, pairs.x0, found.half_cycles, offset), tuple(entries)


def _start(name: str, value: float, oscillator: Oscillator, found: Unwrapped) -> float:
    """Start value of a coefficient: a mu that is free from the dead band of the pairs, others as they are."""
    if name.rsplit(".", 1)[-1] != "mu":
        return value
    return found.dead_band * float(oscillator.stiffness) / float(oscillator.normal_force)


def _sigma(pairs: Pairs, found: Unwrapped, mu_scatter: float) -> np.ndarray:
    """Standard deviation of each final displacement; equal ones where only their scatter can tell [m]."""
    unknown = 0.0 if mu_scatter else 1e-3 * found.dead_band
    own = np.full(pairs.x0.shape, unknown) if pairs.sigma is None else pairs.sigma
    scattered = 2 * np.maximum(found.half_cycles, 0.5) * found.dead_band * mu_scatter
    return np.hypot(own, scattered)


def _assembled(
    pairs: Pairs,
    model: PairModel,
    parameters: tuple[Parameter, ...],
    solution: Solution,
    found: Unwrapped,
    weight: np.ndarray,
    scaled: bool,
) -> RouteFit:
    values = np.asarray(model.space.values(jnp.asarray(solution.q)))
    slope = np.asarray(model.space.slope(jnp.asarray(solution.q)))
    covariance = solution.covariance * np.outer(slope, slope)
    std = np.sqrt(np.diag(covariance))
    names = tuple(parameter.name for parameter in parameters)
    machine = model.space.model(model.oscillator, jnp.asarray(values))
    computed = np.asarray(predicted(model, jnp.asarray(solution.q)))
    static = _static(pairs, model, values, found, machine)
    scale = np.sqrt(solution.chi2 / solution.dof) if scaled else 1.0
    band = fitted_dead_band(model, solution)
    shift = model.space.run_values(jnp.asarray(values), 0).get("offset", found.offset)
    found = found._replace(dead_band=band[0], offset=float(shift))
    warnings = (*remarks(pairs, found, computed, weight * scale, machine, solution.scale), *solution.warnings)
    errors, open_ = dict(zip(names, map(float, std), strict=True)), status_of_counts(found)
    half = solution.scale.half_width
    return RouteFit(
        route="final displacements",
        names=names,
        values=dict(zip(names, map(float, values), strict=True)) | static.value,
        std_errors=errors,
        combined_std_errors=errors,
        units={p.name: p.unit for p in parameters} | dict.fromkeys(static.value, ""),
        intervals={n: (float(v - half * s), float(v + half * s)) for n, v, s in zip(names, values, std, strict=True)}
        | static.interval,
        covariance=covariance,
        flags=flags_of(names, solution) | dict.fromkeys(static.value, ("bracketed, not fitted",)),
        converged=solution.converged and open_ is None,
        status=open_ if solution.converged and open_ is not None else status_of(names, solution),
        warnings=warnings,
        x0=pairs.x0,
        xf=pairs.xf,
        predicted=computed,
        half_cycles=found.half_cycles,
        sigma=weight * scale,
        sigma_source="scatter of the residuals" if scaled else "given",
        chi2=float(solution.dof) if scaled else solution.chi2,
        dof=solution.dof,
        extras={"dead_band": band},
    )


class _Static(NamedTuple):
    value: dict[str, float]
    interval: dict[str, tuple[float, float]]


def _static(pairs: Pairs, model: PairModel, values: np.ndarray, found: Unwrapped, machine: Oscillator) -> _Static:
    """The static coefficient between the stops and the reversals that did not stop."""
    if sole_coulomb(machine.friction) is None:
        return _Static({}, {})
    offset = float(model.space.run_values(values, 0).get("offset", found.offset))
    between: Bracket = bracket(machine, pairs.x0 - offset, pairs.xf - offset, found.half_cycles)
    return _Static({"mu_s": between.middle}, {"mu_s": (between.lower, between.upper)})
