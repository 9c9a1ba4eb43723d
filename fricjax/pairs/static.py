"""The static coefficient from displacements with stops and non-stops.

Deterministic friction gives an interval. If friction scatters from stop to stop, the probability of a stop is a smooth
step, ``P(stop | |a|) = Phi((x_s - |a|)/s)``, and maximum likelihood gives x_s and s.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..errors import DataError, UsageError
from ..estimation.covariance import LIKELIHOOD_DROP
from ..oscillator import Oscillator, starting_state
from ..oscillator.engines import AbstractEngine
from ..oscillator.select import select_engine
from .unwrapping import capacity_for

# The profile search starts one scatter away from the static band and takes 40 steps in this ratio: eight decades.
_OUTWARDS, _SEARCHED = 1.6, 40


class Bracket(NamedTuple):
    """Interval of the static coefficient mu_s and band mu_s N/k [m].

    Examples:
        >>> round(Bracket(0.05, 0.07, 2e-4, 2.8e-4).middle, 3)
        0.06
    """

    lower: float
    upper: float
    lower_band: float
    upper_band: float

    @property
    def middle(self) -> float:
        """Middle of the interval; its lower end without an upper one."""
        return (self.lower + self.upper) / 2 if np.isfinite(self.upper) else self.lower


class Attempts(NamedTuple):
    """Displacements with zero velocity, and the outcome at each.

    Attributes:
        size: distance from the equilibrium [m], shape (attempts,).
        stopped: True where the mass stayed, shape (attempts,).

    Examples:
        >>> import numpy as np
        >>> Attempts(np.array([2e-3, 1e-4]), np.array([False, True])).stopped.sum()
        np.int64(1)
    """

    size: np.ndarray
    stopped: np.ndarray


def attempts(machine: Oscillator, y0: np.ndarray, yf: np.ndarray, half_cycles: np.ndarray) -> Attempts:
    """Return all states at rest: computed reversals and measured stops.

    The mass moved on from each reversal.

    Args:
        machine: the fitted machine.
        y0: initial displacement from the equilibrium [m], shape (pairs,).
        yf: final displacement from the equilibrium [m], shape (pairs,).
        half_cycles: number of half-cycles, shape (pairs,).

    Examples:
        From 0.7 mm with a dead band of 0.2 mm: release, one reversal and stop.

        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.0, 10.0, fj.friction.Coulomb(0.05))
        >>> at_rest = attempts(machine, np.array([0.7e-3]), np.array([-0.1e-3]), np.array([2]))
        >>> (1e3 * at_rest.size).round(6), at_rest.stopped
        (array([0.7, 0.3, 0.1]), array([False, False,  True]))
    """
    reversals = np.abs(reversals_of(machine, y0, half_cycles))
    moved = np.arange(reversals.shape[1]) < half_cycles[:, None]
    sizes = np.concatenate([reversals[moved], np.abs(yf)])
    return Attempts(sizes, np.arange(sizes.size) >= moved.sum())


def reversals_of(machine: Oscillator, x0: np.ndarray, half_cycles: np.ndarray) -> np.ndarray:
    """Return the turning points of runs with given numbers of half-cycles.

    The runs continue even if friction would hold the mass.

    Args:
        machine: the machine, with a set-valued law.
        x0: initial displacements from the equilibrium [m], shape (runs,).
        half_cycles: their numbers of half-cycles, shape (runs,).

    Returns:
        The initial displacements followed by the turning points [m], shape (runs, points).
    """
    exact = jax.tree.map(lambda leaf: np.asarray(leaf, float), machine)
    engine = select_engine("auto", exact, max_half_cycles=capacity_for(half_cycles))
    return np.asarray(_turning_points(engine, exact, x0, half_cycles))


@eqx.filter_jit
def _turning_points(engine: AbstractEngine, machine: Oscillator, x0: Any, half_cycles: Any) -> Any:
    """Return initial displacement and turning points, shape (runs, points)."""

    def points(start: Any, count: Any) -> Any:
        return engine.solve(machine, starting_state(machine, start, 0.0), jnp.zeros(1), count).turning_points

    return jax.vmap(points)(x0, half_cycles)


def bracket(machine: Oscillator, y0: np.ndarray, yf: np.ndarray, half_cycles: np.ndarray) -> Bracket:
    """Bracket the static coefficient of a Coulomb law.

    It is above every stop and above mu, and below every non-stop.

    Args:
        machine: the fitted machine.
        y0: initial displacement from the equilibrium [m], shape (pairs,).
        yf: final displacement from the equilibrium [m], shape (pairs,).
        half_cycles: number of half-cycles, shape (pairs,).

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.0, 10.0, fj.friction.Coulomb(0.05))
        >>> interval = bracket(machine, np.array([0.7e-3]), np.array([-0.1e-3]), np.array([2]))
        >>> round(interval.lower, 6), round(interval.upper, 6)
        (0.05, 0.075)
    """
    at_rest = attempts(machine, y0, yf, half_cycles)
    force = np.abs(np.asarray(machine.restoring_force(jnp.asarray(at_rest.size)))) / float(machine.normal_force)
    dynamic = float(machine.friction.dynamic_force(machine.normal_force)) / float(machine.normal_force)
    lower = max(dynamic, float(force[at_rest.stopped].max(initial=0.0)))
    upper = float(force[~at_rest.stopped].min(initial=np.inf))
    scale = float(machine.normal_force) / float(machine.stiffness)
    return Bracket(lower, upper, lower * scale, upper * scale)


class Probit(NamedTuple):
    """Static band with scatter.

    Attributes:
        static_band, scatter: x_s and s [m].
        std_errors: of x_s and of s, from the curvature of the likelihood [m].
        interval: 95 % interval of x_s from the profile likelihood [m].

    Examples:
        >>> Probit(2.6e-4, 3e-5, (1e-5, 8e-6), (2.4e-4, 2.8e-4)).static_band
        0.00026
    """

    static_band: float
    scatter: float
    std_errors: tuple[float, float]
    interval: tuple[float, float]


def probit(size: np.ndarray, stopped: np.ndarray) -> Probit:
    """Estimate the static band and its scatter by maximum likelihood.

    Args:
        size: displacements with zero velocity [m], shape (attempts,).
        stopped: True where the mass stayed, shape (attempts,).

    Raises:
        UsageError: arrays of different lengths.
        DataError: stops and non-stops do not overlap, so that the data do not show a scatter; use :func:`bracket`. Or
            stops occur at larger displacements than non-stops.

    Examples:
        >>> import numpy as np
        >>> size = 1e-4 * np.array([1.0, 1.5, 2.0, 2.2, 2.4, 2.6, 3.0, 4.0])
        >>> estimate = probit(size, np.array([True, True, True, False, True, False, False, False]))
        >>> round(1e4 * estimate.static_band, 2), round(1e4 * estimate.scatter, 2)
        (2.3, 0.3)
    """
    from scipy.optimize import brentq, minimize, minimize_scalar

    size, stopped = np.asarray(size, float), np.asarray(stopped, bool)
    if size.ndim != 1 or size.shape != stopped.shape:
        raise UsageError(f"size and stopped must be lists of equal length, got {size.shape} and {stopped.shape}.")
    if not stopped.any() or stopped.all() or size[stopped].max() < size[~stopped].min():
        raise DataError(
            "Stops and non-stops do not overlap, so no scatter of the static friction shows. Use the bracket."
        )
    unit = float(np.median(size[stopped]))
    z, sign = size / unit, np.where(stopped, 1.0, -1.0)

    def negative(at: np.ndarray) -> float:
        return -_log_likelihood(z, sign, *at)[0]

    # The likelihood is concave in alpha = x_s/s and beta = 1/s, so Newton's method in a trust region converges, while
    # x_s and s diverge from poor start values.
    beta = 4 / max(float(np.std(z)), 1e-9)
    alpha = beta * float((z[stopped].max() + z[~stopped].min()) / 2)
    optimum = minimize(
        negative,
        np.array([alpha, beta]),
        method="trust-exact",
        jac=lambda at: -_log_likelihood(z, sign, *at)[1],
        hess=lambda at: _log_likelihood(z, sign, *at)[2],
        options={"gtol": 1e-9},
    )
    alpha, beta = map(float, optimum.x)
    if not beta > 0:
        raise DataError(
            "The mass did not stop more seldom at larger deflections, so they determine no static friction. Check "
            "which of the attempts are stops, or record more of them."
        )
    largest, _, information = _log_likelihood(z, sign, alpha, beta)
    covariance = np.linalg.inv(information)
    centre, by_centre = alpha / beta, np.array([1 / beta, -alpha / beta**2])
    stds = np.sqrt(by_centre @ covariance @ by_centre), np.sqrt(covariance[1, 1]) / beta**2

    def excess(place: float) -> float:
        """Return the drop of the profile likelihood minus that of the interval."""
        profile: Any = minimize_scalar(lambda log_beta: negative(np.exp(log_beta) * np.array([place, 1.0])))
        return 2 * (largest + profile.fun) - LIKELIHOOD_DROP

    ends = []
    for side in (-1.0, 1.0):
        reach = np.cumprod([1 / beta, *[_OUTWARDS] * (_SEARCHED - 1)])
        outside = next((r for r in reach if excess(centre + side * r) > 0), None)
        ends.append(side * np.inf if outside is None else brentq(excess, centre, centre + side * outside, xtol=1e-9))
    return Probit(
        centre * unit, 1 / beta * unit, (float(stds[0] * unit), float(stds[1] * unit)), (ends[0] * unit, ends[1] * unit)
    )


def _log_likelihood(z: np.ndarray, sign: np.ndarray, alpha: float, beta: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Return log-likelihood of ``P = Phi(alpha - beta z)``, gradient and information."""
    from scipy.special import log_ndtr

    at = sign * (alpha - beta * z)
    logs = log_ndtr(at)
    # Inverse Mills ratio phi/Phi from logarithms, which is stable far in the tail.
    mills = np.exp(-(at**2) / 2 - np.log(2 * np.pi) / 2 - logs)
    columns = np.stack([np.ones_like(z), -z], axis=1) * sign[:, None]
    information = columns.T @ ((mills * (mills + at))[:, None] * columns)
    return float(logs.sum()), columns.T @ mills, information
