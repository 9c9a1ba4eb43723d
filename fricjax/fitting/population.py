"""From the coefficients of single runs to that of the contact: their mean and their scatter from run to run.

Each run has its own coefficient, ``mu_i ~ N(mu, s^2)``, and tells it with its own standard error. The scatter s is that
of largest restricted likelihood, which unlike plain maximum likelihood does not lose the degree of freedom of the mean;
its interval holds the scatters for which ``sum (mu_i - mu)^2/(s^2 + u_i^2)`` is a plausible chi^2 (Viechtbauer, Stat.
Med. 26, 37, 2007). The mean's standard error takes the scatter as estimated (Knapp and Hartung, Stat. Med. 22, 2693,
2003).
"""

from typing import Any, NamedTuple

import numpy as np

from ..data.errors import DataError

_LEVEL = 0.95
_LARGEST = 1e3


class Population(NamedTuple):
    """A coefficient over many runs.

    Attributes:
        mean: of the runs; `std`: its standard error, and `interval`: its 95 % interval by Student's t.
        scatter: standard deviation from run to run; `scatter_interval`: its 95 % interval.
        runs: number of runs that it rests on.
    """

    mean: float
    std: float
    interval: tuple[float, float]
    scatter: float
    scatter_interval: tuple[float, float]
    runs: int


def population(values: np.ndarray, std_errors: np.ndarray) -> Population:
    """Mean and scatter of a coefficient from those of single runs; runs that are not finite are left out.

    Args:
        values: coefficient of each run, shape (runs,).
        std_errors: its standard error by the noise of the run alone, shape (runs,).

    Raises:
        DataError: fewer than three runs with a finite value and a finite standard error.
    """
    used = np.isfinite(values) & np.isfinite(std_errors) & (std_errors > 0)
    z, u = np.asarray(values)[used], np.asarray(std_errors)[used]
    if z.size < 3:
        raise DataError(f"A scatter from run to run needs at least three fitted runs, got {z.size}.")
    scatter = _most_likely(z, u)
    mean, weights = _mean(z, u, scatter)
    excess = float(weights @ (z - mean) ** 2) / (z.size - 1)
    std = float(np.sqrt(max(excess, 1.0) / weights.sum()))
    from scipy.stats import t

    reach = float(t.ppf((1 + _LEVEL) / 2, z.size - 1)) * std
    return Population(mean, std, (mean - reach, mean + reach), scatter, _interval(z, u), int(z.size))


def _mean(z: np.ndarray, u: np.ndarray, scatter: float) -> tuple[float, np.ndarray]:
    """Weighted mean, and the weights."""
    weights = 1 / (u**2 + scatter**2)
    return float(weights @ z / weights.sum()), weights


def _most_likely(z: np.ndarray, u: np.ndarray) -> float:
    """Scatter of largest restricted likelihood, zero where the standard errors explain everything."""
    from scipy.optimize import minimize_scalar

    unit = float(np.std(z, ddof=1))

    def loss(scatter: float) -> float:
        mean, weights = _mean(z, u, scatter)
        return float(weights @ (z - mean) ** 2 - np.log(weights).sum() + np.log(weights.sum()))

    if unit == 0:
        return 0.0
    found: Any = minimize_scalar(lambda s: loss(s * unit), bounds=(0, 5), method="bounded", options={"xatol": 1e-9})
    return 0.0 if loss(0.0) <= found.fun else float(found.x) * unit


def _interval(z: np.ndarray, u: np.ndarray) -> tuple[float, float]:
    """Scatters for which the weighted sum of squares is a plausible chi^2."""
    from scipy.optimize import brentq
    from scipy.stats import chi2

    def squares(scatter: float) -> float:
        mean, weights = _mean(z, u, scatter)
        return float(weights @ (z - mean) ** 2)

    def where(quantile: float) -> float:
        sought = float(chi2.ppf(quantile, z.size - 1))
        largest = _LARGEST * max(float(np.std(z, ddof=1)), float(u.max()))
        return 0.0 if squares(0.0) <= sought else float(brentq(lambda s: squares(s) - sought, 0.0, largest))  # pyright: ignore[reportArgumentType]

    return where((1 + _LEVEL) / 2), where((1 - _LEVEL) / 2)
