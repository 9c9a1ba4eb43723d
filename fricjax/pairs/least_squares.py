"""Computed final displacements and their least-squares fit to measured ones."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..estimation.covariance import quadratic
from ..estimation.levenberg_marquardt import LevenbergMarquardt
from ..estimation.space import ParameterSpace
from ..estimation.status import CONVERGED, NOT_FINITE, UNDETERMINED
from ..oscillator import Oscillator, starting_state
from ..oscillator.engines import AbstractEngine
from ..rig import Measured
from .diagnostics import Scale, scale_of
from .displacements import Pairs

# A time after which every motion has come to rest [s].
_FAR = 1e30
# Rounding of the computed displacements, relative to the largest initial one.
_ROUNDING = 1e-13
# Largest number of corrections of the half-cycle counts by the fitted law; they settle after one or two.
_ROUNDS = 5


class PairModel(eqx.Module):
    """Computed final displacements as a function of the coordinates."""

    oscillator: Oscillator
    space: ParameterSpace
    engine: AbstractEngine
    x0: Float[np.ndarray, " pairs"]
    half_cycles: Any
    offset: Any

    def __call__(self, q: Float[Array, " p"]) -> Float[Array, " pairs"]:
        values = self.space.values(q)
        machine = self.space.model(self.oscillator, values)
        offset = self.space.run_values(values, 0).get("offset", jnp.asarray(self.offset))

        def final(x0: Array, count: Array) -> Array:
            path = self.engine.path(machine, starting_state(machine, x0 - offset, 0.0), count)
            return path.sample(jnp.asarray([_FAR]))[0][0] + offset

        return jax.vmap(final)(jnp.asarray(self.x0), self.half_cycles)


class _Residual(eqx.Module):
    """Computed minus measured final displacements, in standard deviations.

    It is a module, so that another campaign with the same array shapes does not recompile.
    """

    model: PairModel
    xf: Float[np.ndarray, " pairs"]
    sigma: Float[np.ndarray, " pairs"]

    def __call__(self, q: Float[Array, " p"]) -> Float[Array, " pairs"]:
        return (self.model(q) - self.xf) / self.sigma


class Solution(NamedTuple):
    """Result of the fit.

    Attributes:
        q: coordinates, shape (p,); `covariance`: of the coordinates, shape (p, p), inf where undetermined.
        undetermined: coordinates that the data do not determine, shape (p,).
        chi2, dof: sum of squared weighted residuals and degrees of freedom, at least one.
        scale: factor on the standard errors, and width of intervals.
        status: status of the solver; `warnings`: in sentences.
    """

    q: np.ndarray
    covariance: np.ndarray
    undetermined: np.ndarray
    chi2: float
    dof: int
    scale: Scale
    status: int
    warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """True if the fit converged and determines every parameter."""
        return self.status == CONVERGED and not self.undetermined.any()

    def outcome(self, names: tuple[str, ...]) -> str:
        """Return the status in words."""
        if self.status == NOT_FINITE:
            return "not finite: the model fails at the start values. Check the coefficients of the oscillator."
        if self.undetermined.any() or self.status == UNDETERMINED:
            lost = ", ".join(name for name, bad in zip(names, self.undetermined, strict=True) if bad)
            return (
                f"undetermined: the pairs do not determine {lost or 'a combination'}. Fix one parameter, or add pairs "
                "of other amplitudes."
            )
        if self.status != CONVERGED:
            return "stalled: the optimum was not reached. Check the numbers of half-cycles."
        return "converged"


def solve_pairs(
    pairs: Pairs, model: PairModel, sigma: np.ndarray, parameters: int, scaled: bool
) -> tuple[PairModel, Solution]:
    """Fit the pairs; correct the unknown numbers of half-cycles.

    A number changes by one if the fitted law fits better with it.

    Args:
        pairs: measured displacements.
        model: computed displacements.
        sigma: standard deviations of the final displacements [m], shape (pairs,).
        parameters: number of coordinates.
        scaled: True if the noise follows from the scatter of the residuals, which is never below rounding.
    """
    floor = float(np.sum((_ROUNDING * np.max(np.abs(pairs.x0)) / sigma) ** 2))
    for _ in range(_ROUNDS):
        solution = _minimise(_Residual(model, pairs.xf, sigma), parameters, scaled, floor)
        nearest = model.half_cycles if pairs.half_cycles is not None else _nearest(model, solution.q, pairs.xf)
        if np.array_equal(nearest, model.half_cycles):
            break
        model = eqx.tree_at(lambda m: m.half_cycles, model, nearest)
    return model, solution


def _nearest(model: PairModel, q: np.ndarray, xf: np.ndarray) -> np.ndarray:
    """Return the number of half-cycles nearest to each final displacement.

    The candidates are the present number, one less and one more.
    """
    rivals = [np.maximum(model.half_cycles + step, 0) for step in (0, -1, 1)]
    ends = [predicted(eqx.tree_at(lambda m: m.half_cycles, model, n), jnp.asarray(q)) for n in rivals]
    away = np.nan_to_num(np.abs(np.asarray(ends) - xf), nan=np.inf)
    return np.stack(rivals)[np.argmin(away, axis=0), np.arange(xf.size)]


def _minimise(residual: _Residual, parameters: int, scaled: bool, floor: float) -> Solution:
    """Minimise from the origin; return the solution with its uncertainty."""
    q, stats = jax.tree.map(np.asarray, _least_squares(residual, jnp.zeros(parameters), np.asarray(floor)))
    spare, chi2 = residual.xf.size - parameters, max(2 * float(stats["cost"]), floor if scaled else 0.0)
    model = quadratic(stats["gradient"], stats["normal"], np.zeros(parameters, bool))
    scale = scale_of(chi2, spare, known=not scaled)
    unknown = model.undetermined | (not np.isfinite(scale.factor))
    covariance = (scale.factor if np.isfinite(scale.factor) else 1.0) ** 2 * model.inverse
    covariance[unknown, :] = covariance[:, unknown] = 0.0
    covariance[unknown, unknown] = np.inf
    no_scatter = "As many parameters as pairs: the scatter gives no uncertainty."
    warnings = () if spare or not scaled else (no_scatter,)
    return Solution(q, covariance, model.undetermined, chi2, max(spare, 1), scale, int(stats["status"]), warnings)


@eqx.filter_jit
def _least_squares(residual: _Residual, start: Array, floor: Any) -> tuple[Array, dict[str, Any]]:
    """Return the optimal coordinates and the statistics of the solver.

    The model is compiled once.
    """
    wide, dof = jnp.full(start.shape, jnp.inf), max(residual.xf.size - start.size, 1)
    options = {"lower": -wide, "upper": wide, "dof": jnp.asarray(float(dof)), "floor": floor}
    solution = optx.least_squares(lambda q, _: residual(q), LevenbergMarquardt(), start, options=options, throw=False)
    return solution.value, {name: solution.stats[name] for name in ("cost", "gradient", "normal", "status")}


@eqx.filter_jit
def predicted(model: PairModel, q: Array) -> Array:
    """Return computed final displacements at `q` [m], shape (pairs,)."""
    return model(q)


def fitted_dead_band(model: PairModel, solution: Solution) -> Measured:
    """Return the dead band mu N/k [m] with its standard error."""

    def band(q: Array) -> Array:
        return model.space.model(model.oscillator, model.space.values(q)).dead_band

    q = jnp.asarray(solution.q)
    slope = np.asarray(jax.jacfwd(band)(q))
    # An undetermined parameter without influence on the dead band has infinite variance, and 0 inf would be NaN.
    used = slope != 0
    variance = slope[used] @ solution.covariance[np.ix_(used, used)] @ slope[used]
    return Measured(float(band(q)), float(np.sqrt(variance)), "m")
