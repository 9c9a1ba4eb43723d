"""Computed final displacements of a campaign of releases, and their fit to the measured ones."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimation.space import ParameterSpace
from ..oscillator import Oscillator, starting_state
from ..oscillator.engines import AbstractEngine
from .displacements import Pairs
from .solve import Solution, minimise

_FAR = 1e30
_ROUNDING = 1e-13
_ROUNDS = 5


class PairModel(eqx.Module):
    """Computed final displacements as a function of the coordinates of the parameters."""

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
    """Computed minus measured final displacements, in standard deviations."""

    model: PairModel
    xf: Float[np.ndarray, " pairs"]
    sigma: Float[np.ndarray, " pairs"]

    def __call__(self, q: Float[Array, " p"]) -> Float[Array, " pairs"]:
        return (self.model(q) - self.xf) / self.sigma


def solve_pairs(
    pairs: Pairs, model: PairModel, weight: np.ndarray, parameters: int, scaled: bool
) -> tuple[PairModel, Solution]:
    """The fit; numbers of half-cycles that were not given are corrected by one where the fitted law says so."""
    floor = float(np.sum((_ROUNDING * np.max(np.abs(pairs.x0)) / weight) ** 2))
    for _ in range(_ROUNDS):
        solution = minimise(_Residual(model, pairs.xf, weight), parameters, scaled=scaled, floor=floor)
        nearest = model.half_cycles if pairs.half_cycles is not None else _nearest(model, solution.q, pairs.xf)
        if np.array_equal(nearest, model.half_cycles):
            break
        model = eqx.tree_at(lambda m: m.half_cycles, model, nearest)
    return model, solution


def _nearest(model: PairModel, q: np.ndarray, xf: np.ndarray) -> np.ndarray:
    """For each pair its number of half-cycles, one less or one more: whichever ends nearest to its displacement."""
    rivals = [np.maximum(model.half_cycles + step, 0) for step in (0, -1, 1)]
    ends = [predicted(eqx.tree_at(lambda m: m.half_cycles, model, n), jnp.asarray(q)) for n in rivals]
    away = np.nan_to_num(np.abs(np.asarray(ends) - xf), nan=np.inf)
    return np.stack(rivals)[np.argmin(away, axis=0), np.arange(xf.size)]


@eqx.filter_jit
def predicted(model: PairModel, q: Array) -> Array:
    """Computed final displacements at the coordinates `q` [m], shape (pairs,)."""
    return model(q)


def fitted_dead_band(model: PairModel, solution: Solution) -> tuple[float, float, str]:
    """Dead band x_d = mu N/k of the fitted machine [m], with its standard error."""

    def band(q: Array) -> Array:
        return model.space.model(model.oscillator, model.space.values(q)).dead_band

    q = jnp.asarray(solution.q)
    slope = np.asarray(jax.jacfwd(band)(q))
    used = slope != 0
    variance = slope[used] @ solution.covariance[np.ix_(used, used)] @ slope[used]
    return float(band(q)), float(np.sqrt(variance)), "m"
