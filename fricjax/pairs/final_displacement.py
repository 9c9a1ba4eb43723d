"""Route 2: coefficients from initial and final displacements, without a trace.

For given numbers of half-cycles the final displacement is a smooth, nearly linear function of the dynamic coefficient.
It does not depend on the static coefficient, which is bracketed instead: it lies between the turning points at which
the mass stopped and those at which it moved on.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import DataError, UsageError, check_type
from ..estimation.space import Parameter, ParameterSpace
from ..fitting.names import check_identifiable, find_leaf, sole_coulomb
from ..oscillator import Oscillator, ready
from ..oscillator.oscillator import leaves_of
from ..oscillator.select import select_engine
from ..settings import check_scatter
from .diagnostics import fit_warnings, status_of_counts
from .displacements import Pairs, checked_pairs
from .least_squares import PairModel, Solution, fitted_dead_band, predicted, solve_pairs
from .result import RouteFit
from .static import bracket
from .unwrapping import Unwrapped, capacity_for, count_half_cycles, decay_ratio


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
        x0: initial displacements as read from the instrument [m], shape (pairs,), of any sign and in any order. A slow
            release biases them; :func:`pairs_of` uses the first reversal instead.
        xf: final displacements [m], shape (pairs,).
        oscillator: the machine; its fixed coefficients are taken as exact. Its static coefficient is not used.
        free: names of the coefficients to fit; "mu_s" requests the bracket of the static coefficient.
        nuisance: "offset" if the equilibrium position is unknown; this needs runs with different numbers of half-cycles
            or of both signs.
        half_cycles: number of half-cycles of each pair, shape (pairs,); None: determined from the pairs, for a law
            close to Coulomb friction.
        sigma: standard deviation of each final displacement [m], one number or shape (pairs,); None: from the scatter.
        mu_scatter: relative standard deviation of mu from run to run, which scatters a final displacement in
            proportion to its number of half-cycles.

    Returns:
        The fit. For Coulomb laws ``intervals["mu_s"]`` is the bracket of the static coefficient and ``values["mu_s"]``
        its middle; the upper end is infinite if no reversal exceeded it.

    Raises:
        UsageError: names or arrays that do not fit.
        DataError: pairs that are not finite, or that determine no coefficient.
        RuntimeError: JAX computes in single precision.

    Examples:
        Final displacements of a machine without damping and with a dead band of 0.2 mm:

        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.0, 10.0, fj.friction.Coulomb(0.03))
        >>> fit = fj.fit_final_displacements([1.1e-3, 1.5e-3, 2.1e-3], [1e-4, -1e-4, -1e-4], machine)
        >>> round(fit.values["mu"], 6), fit.half_cycles.tolist(), [round(x, 3) for x in fit.intervals["mu_s"]]
        (0.05, [3, 4, 5], [0.05, 0.075])
    """
    ready()
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    pairs = checked_pairs(x0, xf, half_cycles, sigma)
    coulomb = sole_coulomb(oscillator.friction) is not None
    # The final displacements do not depend on the static coefficient of a Coulomb law, so bracket it instead.
    names = [name for name in free if not (coulomb and name.rsplit(".", 1)[-1] == "mu_s")]
    unknown = [name for name in nuisance if name != "offset"]
    if not names:
        raise UsageError(
            "mu_s alone cannot be fitted: it is bracketed by the reversals that a fitted mu gives. Free mu as well."
        )
    if unknown:
        raise UsageError(f"Pairs have no nuisance parameter {unknown[0]!r}; the only one is 'offset'.")
    check_scatter(mu_scatter)
    # One pair cannot separate an offset from friction.
    offset = None if "offset" in nuisance and pairs.x0.size > 1 else 0.0
    counts = count_half_cycles(pairs.x0, pairs.xf, pairs.half_cycles, decay_ratio(oscillator), offset)
    if not np.any(counts.half_cycles > 0):
        raise DataError(
            "The mass did not complete a half-cycle in any pair: the initial displacements lie in the dead band, "
            "which gives only a lower bound of the static coefficient. Release from farther away."
        )
    different, parameters = np.unique(np.stack([pairs.x0, pairs.xf]), axis=1).shape[1], len(names) + len(nuisance)
    if different < parameters:
        raise DataError(
            f"{different} different pair(s) cannot determine {parameters} parameters. Record more runs from different "
            "initial displacements."
        )
    model, entries = _model(pairs, oscillator, names, tuple(nuisance), counts)
    # Standard deviations; if they follow from the scatter of the residuals, start with equal ones of any size.
    unstated = 0.0 if mu_scatter else 1e-3 * counts.dead_band
    of_pairs = np.full(pairs.x0.shape, unstated) if pairs.sigma is None else pairs.sigma
    weight = np.hypot(of_pairs, 2 * np.maximum(counts.half_cycles, 0.5) * counts.dead_band * mu_scatter)
    scaled = pairs.sigma is None and mu_scatter == 0
    model, solution = solve_pairs(pairs, model, weight, parameters, scaled)
    counts = counts._replace(half_cycles=np.asarray(model.half_cycles))
    return _assembled(pairs, model, entries, solution, counts, weight, scaled)


def _model(
    pairs: Pairs, oscillator: Oscillator, names: Sequence[str], nuisance: tuple[str, ...], counts: Unwrapped
) -> tuple[PairModel, tuple[Parameter, ...]]:
    leaves = leaves_of(oscillator)
    chosen = [find_leaf(name, leaves) for name in names]
    check_identifiable([leaf.name for leaf in chosen], leaves)
    flat = [float(value) for value in jax.tree.leaves(oscillator)]
    entries = []
    for leaf in chosen:
        start = flat[leaf.index]
        if leaf.name.rsplit(".", 1)[-1] == "mu":
            # The dead band from unwrapping is much nearer to the optimum than a guess of the user.
            start = counts.dead_band * float(oscillator.stiffness) / float(oscillator.normal_force)
        fitted_as = leaf.coefficient.fitted_as
        entries.append(Parameter(leaf.name, leaf.unit, start, abs(start) or 1.0, fitted_as=fitted_as))
    entries += [Parameter(name, "m", counts.offset, counts.dead_band) for name in nuisance]
    space = ParameterSpace.build(entries, [leaf.index for leaf in chosen], [], [nuisance])
    engine = select_engine("auto", oscillator, max_half_cycles=capacity_for(counts.half_cycles))
    if not oscillator.friction.set_valued:
        raise UsageError(
            f"Under {type(oscillator.friction).__name__} the mass does not rest where a half-cycle ends. Use a law "
            "that keeps the mass at rest and has no internal states, such as Coulomb or Stribeck."
        )
    machine = jax.tree.map(lambda leaf: np.asarray(leaf, float), oscillator)
    return PairModel(machine, space, engine, pairs.x0, counts.half_cycles, np.asarray(counts.offset)), tuple(entries)


def _assembled(
    pairs: Pairs,
    model: PairModel,
    parameters: tuple[Parameter, ...],
    solution: Solution,
    counts: Unwrapped,
    weight: np.ndarray,
    scaled: bool,
) -> RouteFit:
    q = jnp.asarray(solution.q)
    values, slope = np.asarray(model.space.values(q)), np.asarray(model.space.slope(q))
    covariance = solution.covariance * np.outer(slope, slope)
    names = tuple(parameter.name for parameter in parameters)
    std_errors = dict(zip(names, map(float, np.sqrt(np.diag(covariance))), strict=True))
    fitted = dict(zip(names, map(float, values), strict=True))
    half = solution.scale.half_width
    intervals = {
        name: (fitted[name] - half * std_errors[name], fitted[name] + half * std_errors[name]) for name in names
    }
    units = {parameter.name: parameter.unit for parameter in parameters}
    flags = {n: ("undetermined",) if bad else () for n, bad in zip(names, solution.undetermined, strict=True)}
    machine = model.space.model(model.oscillator, jnp.asarray(values))
    computed = np.asarray(predicted(model, q))
    offset = float(model.space.run_values(jnp.asarray(values), 0).get("offset", counts.offset))
    if sole_coulomb(machine.friction) is not None:
        static = bracket(machine, pairs.x0 - offset, pairs.xf - offset, counts.half_cycles)
        fitted["mu_s"], intervals["mu_s"] = static.middle, (static.lower, static.upper)
        units["mu_s"], flags["mu_s"] = "", ("bracketed, not fitted",)
    scale = np.sqrt(solution.chi2 / solution.dof) if scaled else 1.0
    band = fitted_dead_band(model, solution)
    counts = counts._replace(dead_band=band.value, offset=offset)
    open_counts = status_of_counts(counts) if solution.converged else None
    return RouteFit(
        route="final displacements",
        names=names,
        values=fitted,
        std_errors=std_errors,
        combined_std_errors=std_errors,
        units=units,
        intervals=intervals,
        covariance=covariance,
        flags=flags,
        converged=solution.converged and open_counts is None,
        status=open_counts or solution.outcome(names),
        warnings=(*fit_warnings(pairs, counts, computed, machine, solution.scale), *solution.warnings),
        x0=pairs.x0,
        xf=pairs.xf,
        predicted=computed,
        half_cycles=counts.half_cycles,
        sigma=weight * scale,
        sigma_source="scatter of the residuals" if scaled else "given",
        chi2=float(solution.dof) if scaled else solution.chi2,
        dof=solution.dof,
        extras={"dead_band": band},
    )
