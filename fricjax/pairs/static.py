"""The static coefficient: between the deflections at which the mass stopped and those at which it moved on.

Deterministic friction gives an interval. Where it scatters from stop to stop, the probability of a stop is a smooth
step, ``P(stop | |a|) = Phi((x_s - |a|)/s)``, and both x_s and s follow by maximum likelihood.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..errors import DataError, UsageError
from ..oscillator import Oscillator, starting_state
from ..oscillator.engines import AbstractEngine
from ..oscillator.select import select_engine
from .unwrapping import capacity_for

_LIKELIHOOD_DROP = 3.841458820694124


class Bracket(NamedTuple):
    """Interval of the static coefficient; `lower` and `upper` also as static bands x_s = mu_s N/k [m]."""

    lower: float
    upper: float
    lower_band: float
    upper_band: float

    @property
    def middle(self) -> float:
        """Middle of the interval; its lower end where no reversal gives an upper one."""
        return (self.lower + self.upper) / 2 if np.isfinite(self.upper) else self.lower


class Attempts(NamedTuple):
    """Deflections at which the mass stood still, and whether it stayed: size [m] and `stopped`, shape (attempts,)."""

    size: np.ndarray
    stopped: np.ndarray


def attempts(machine: Oscillator, y0: np.ndarray, yf: np.ndarray, half_cycles: np.ndarray) -> Attempts:
    """All standstills of the pairs: computed reversals, at which the mass moved on, and measured stops.

    Args:
        machine: the fitted machine.
        y0: initial displacement from the equilibrium [m], shape (pairs,).
        yf: final displacement from the equilibrium [m], shape (pairs,).
        half_cycles: number of half-cycles, shape (pairs,).
    """
    held = jax.tree.map(lambda leaf: np.asarray(leaf, float), machine)
    engine = select_engine("auto", held, max_half_cycles=capacity_for(half_cycles))
    reversals = np.abs(np.asarray(_turning_points(engine, held, y0, half_cycles)))
    moved = np.arange(reversals.shape[1]) < half_cycles[:, None]
    sizes = np.concatenate([reversals[moved], np.abs(yf)])
    stopped = np.concatenate([np.zeros(int(moved.sum()), bool), np.ones(yf.size, bool)])
    return Attempts(sizes, stopped)


@eqx.filter_jit
def _turning_points(engine: AbstractEngine, machine: Oscillator, x0: Any, half_cycles: Any) -> Any:
    """Turning points of each run, the initial displacement first, shape (runs, points)."""

    def points(start: Any, count: Any) -> Any:
        return engine.solve(machine, starting_state(machine, start, 0.0), jnp.zeros(1), count).turning_points

    return jax.vmap(points)(x0, half_cycles)


def bracket(machine: Oscillator, y0: np.ndarray, yf: np.ndarray, half_cycles: np.ndarray) -> Bracket:
    """Interval that holds the static coefficient of a Coulomb law: above every stop and mu, below every non-stop."""
    found = attempts(machine, y0, yf, half_cycles)
    force = np.abs(np.asarray(machine.restoring_force(jnp.asarray(found.size)))) / float(machine.normal_force)
    dynamic = float(machine.friction.dynamic_force(machine.normal_force)) / float(machine.normal_force)
    lower = max(dynamic, float(force[found.stopped].max(initial=0.0)))
    upper = float(force[~found.stopped].min(initial=np.inf))
    scale = float(machine.normal_force) / float(machine.stiffness)
    return Bracket(lower, upper, lower * scale, upper * scale)


class Probit(NamedTuple):
    """Static band with scatter.

    Attributes:
        static_band, scatter: x_s and s [m].
        std_errors: of x_s and of s, from the curvature of the likelihood [m].
        interval: 95 % interval of x_s from the profile likelihood [m].
    """

    static_band: float
    scatter: float
    std_errors: tuple[float, float]
    interval: tuple[float, float]


def probit(size: np.ndarray, stopped: np.ndarray) -> Probit:
    """Static band and its scatter by maximum likelihood.

    Args:
        size: deflections at standstills [m], shape (attempts,).
        stopped: whether the mass stayed there, shape (attempts,).

    Raises:
        UsageError: arrays that do not fit each other.
        DataError: stops and non-stops that do not overlap, so that no scatter shows; :func:`bracket` then says all. Or
            stops at larger deflections than non-stops.
    """
    size, stopped = np.asarray(size, float), np.asarray(stopped, bool)
    if size.ndim != 1 or size.shape != stopped.shape:
        raise UsageError(f"size and stopped must be lists of equal length, got {size.shape} and {stopped.shape}.")
    if not stopped.any() or stopped.all() or size[stopped].max() < size[~stopped].min():
        raise DataError(
            "Stops and non-stops do not overlap, so no scatter of the static friction shows. Use the bracket."
        )
    unit = float(np.median(size[stopped]))
    z, sign = size / unit, np.where(stopped, 1.0, -1.0)
    best = _maximum(z, sign)
    low, high = (_profile_end(z, sign, best, side) for side in (-1.0, 1.0))
    std = np.sqrt(np.diag(np.linalg.inv(best.information)))
    centre, spread = best.slope_form
    return Probit(centre * unit, spread * unit, _std_errors(best, std, unit), (low * unit, high * unit))


class _Best(NamedTuple):
    """Maximum of the likelihood in ``P = Phi(alpha - beta z)``, in which it is concave."""

    alpha: float
    beta: float
    log_likelihood: float
    information: np.ndarray

    @property
    def slope_form(self) -> tuple[float, float]:
        return self.alpha / self.beta, 1 / self.beta


def _std_errors(best: _Best, std: np.ndarray, unit: float) -> tuple[float, float]:
    inverse = np.linalg.inv(best.information)
    by_centre = np.array([1 / best.beta, -best.alpha / best.beta**2])
    return float(np.sqrt(by_centre @ inverse @ by_centre) * unit), float(std[1] / best.beta**2 * unit)


def _terms(z: np.ndarray, sign: np.ndarray, alpha: float, beta: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Log likelihood, its gradient and the information in alpha and beta."""
    from scipy.special import log_ndtr

    at = sign * (alpha - beta * z)
    logs = log_ndtr(at)
    mills = np.exp(-(at**2) / 2 - np.log(2 * np.pi) / 2 - logs)
    columns = np.stack([np.ones_like(z), -z], axis=1) * sign[:, None]
    information = columns.T @ ((mills * (mills + at))[:, None] * columns)
    return float(logs.sum()), columns.T @ mills, information


def _maximum(z: np.ndarray, sign: np.ndarray) -> _Best:
    """The maximum of the likelihood, which is concave.

    Raises:
        DataError: deflections at which the mass stops no more seldom where they are larger.
    """
    from scipy.optimize import minimize

    beta = 4 / max(float(np.std(z)), 1e-9)
    start = np.array([beta * float((z[sign > 0].max() + z[sign < 0].min()) / 2), beta])
    found = minimize(
        lambda at: -_terms(z, sign, *at)[0],
        start,
        method="trust-exact",
        jac=lambda at: -_terms(z, sign, *at)[1],
        hess=lambda at: _terms(z, sign, *at)[2],
        options={"gtol": 1e-9},
    )
    alpha, beta = map(float, found.x)
    if not beta > 0:
        raise DataError(
            "The mass did not stop more seldom at larger deflections, so they tell no static friction. Check which of "
            "the attempts are stops, or record more of them."
        )
    value, _, information = _terms(z, sign, alpha, beta)
    return _Best(alpha, beta, value, information)


def _profile_end(z: np.ndarray, sign: np.ndarray, best: _Best, side: float) -> float:
    """Where the profile likelihood of x_s has fallen by half of the 95 % point of chi^2; infinite if it never does."""
    from scipy.optimize import brentq, minimize_scalar

    centre, spread = best.slope_form

    def drop(place: float) -> float:
        held: Any = minimize_scalar(lambda log_beta: -_terms(z, sign, np.exp(log_beta) * place, np.exp(log_beta))[0])
        return 2 * (best.log_likelihood + held.fun) - _LIKELIHOOD_DROP

    reach = spread
    for _ in range(40):
        if drop(centre + side * reach) > 0:
            return brentq(drop, centre, centre + side * reach, xtol=1e-9)  # pyright: ignore[reportReturnType]
        reach *= 1.6
    return side * np.inf
