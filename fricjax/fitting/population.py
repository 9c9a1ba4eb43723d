"""Mean of a coefficient over runs, and its scatter between runs.

Each run has its coefficient ``mu_i ~ N(mu, s^2)``, measured with a standard error u_i. The scatter s maximises the
restricted likelihood, which accounts for the degree of freedom of the mean. Its interval contains the scatters for
which ``sum (mu_i - mu)^2/(s^2 + u_i^2)`` is a plausible chi^2 (Viechtbauer, Stat. Med. 26, 37, 2007). The standard
error of the mean accounts for the estimated scatter (Knapp and Hartung, Stat. Med. 22, 2693, 2003).

These methods assume normal scatter, and a run in the wrong unit would distort them. So outliers are excluded first, by
a forward search (Hadi, J. R. Stat. Soc. B 56, 393, 1994). It starts with the half of the runs nearest to the median,
and repeatedly adds the runs that the current ones predict. A run is an outlier if its distance from the mean of the
others, in standard deviations of that distance, exceeds the quantile of Student's t at a level of 0.001 for all runs
together (Bonferroni).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..data.segmentation.noise import NORMAL_MAD
from ..errors import DataError
from ..show import interval, uncertain

_LEVEL = 0.95
_LARGEST = 1e3
# Fewest runs for an estimate of the scatter.
_FEWEST = 3


class Population(NamedTuple):
    """A coefficient over many runs.

    Attributes:
        mean: mean of the runs; `std`: its standard error, and `interval`: its 95 % interval by Student's t.
        combined_std: standard error of the mean including the uncertain inputs of the rig, common to all runs.
        scatter: standard deviation between runs; `scatter_interval`: its 95 % interval.
        runs: number of runs used.
        outliers: numbers of excluded runs, which are inconsistent with the others.
        left_out: numbers of the runs without a valid value.
    """

    mean: float
    std: float
    interval: tuple[float, float]
    scatter: float
    scatter_interval: tuple[float, float]
    runs: int
    combined_std: float
    outliers: tuple[int, ...] = ()
    left_out: tuple[int, ...] = ()

    def __str__(self) -> str:
        text = (
            f"{uncertain(self.mean, self.combined_std, '')} over {self.runs} runs, scatter from run to run "
            f"{self.scatter:.2g} in {interval(*self.scatter_interval)}"
        )
        for what, numbers in (("outliers set aside", self.outliers), ("not valid", self.left_out)):
            plural = "s" if len(numbers) > 1 else ""
            text += f"; {what}: run{plural} {', '.join(map(str, numbers))}" if numbers else ""
        return text


def population(values: np.ndarray, std_errors: np.ndarray, contributions: Sequence[np.ndarray] = ()) -> Population:
    """Estimate mean and scatter of a coefficient from those of single runs.

    Runs with values that are not finite are ignored.

    Args:
        values: coefficient of each run, shape (runs,).
        std_errors: its standard error from the noise of the run alone, shape (runs,).
        contributions: change of the coefficient in each run per standard uncertainty of each rig input, which is common
            to all runs; each of shape (runs,).

    Raises:
        DataError: fewer than three runs with a finite value and a finite standard error.
    """
    used = np.isfinite(values) & np.isfinite(std_errors) & (np.asarray(std_errors) > 0)
    z, u = np.asarray(values)[used], np.asarray(std_errors)[used]
    if z.size < _FEWEST:
        raise DataError(f"A scatter from run to run needs at least three fitted runs, got {z.size}.")
    belongs = _belonging(z, u)
    numbers = np.flatnonzero(used)
    common = np.reshape(contributions, (-1, used.size))[:, numbers[belongs]]
    return _of(z[belongs], u[belongs], common)._replace(
        outliers=tuple(map(int, numbers[~belongs])), left_out=tuple(map(int, np.flatnonzero(~used)))
    )


def _of(z: np.ndarray, u: np.ndarray, common: np.ndarray) -> Population:
    """Return the population of consistent runs.

    `common` is their change by each rig input, shape (inputs, runs).
    """
    scatter = _most_likely(z, u)
    mean, std = _centre(z, u, scatter)
    reach = _quantile((1 + _LEVEL) / 2, z.size - 1) * std
    weights = _mean(z, u, scatter)[1]
    combined = float(np.linalg.norm([std, *(common @ weights / weights.sum())]))
    return Population(mean, std, (mean - reach, mean + reach), scatter, _interval(z, u), int(z.size), combined)


def _centre(z: np.ndarray, u: np.ndarray, scatter: float) -> tuple[float, float]:
    """Return the weighted mean and its standard error.

    The error is not below that from the errors of the runs.
    """
    mean, weights = _mean(z, u, scatter)
    excess = float(weights @ (z - mean) ** 2) / (z.size - 1)
    return mean, float(np.sqrt(max(excess, 1.0) / weights.sum()))


def _quantile(level: float, dof: int) -> float:
    from scipy.stats import t

    return float(t.ppf(level, dof))


def _belonging(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return True for runs that are consistent, shape (runs,)."""
    middle = np.median(z)
    spread = np.median(np.abs(z - middle)) / NORMAL_MAD
    distance = np.abs(z - middle) / np.hypot(spread, u)
    belongs = np.zeros(z.size, bool)
    belongs[np.argsort(distance, kind="stable")[: max(z.size // 2 + 1, _FEWEST)]] = True
    while not belongs.all():
        near = ~belongs & _predicted(z, u, belongs)
        if not near.any():
            break
        belongs |= near
    return belongs


def _predicted(z: np.ndarray, u: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return True for runs that the `known` ones predict."""
    scatter = _most_likely(z[known], u[known])
    mean, std = _centre(z[known], u[known], scatter)
    # The half nearest to the median scatters less than the whole. So some searches end early: about one normal sample
    # in a hundred loses a run.
    furthest = _quantile(1 - thresholds.RARE / (2 * z.size), int(known.sum()) - 1)
    return np.abs(z - mean) <= furthest * np.sqrt(scatter**2 + u**2 + std**2)


def _mean(z: np.ndarray, u: np.ndarray, scatter: float) -> tuple[float, np.ndarray]:
    """Return the weighted mean and the weights."""
    weights = 1 / (u**2 + scatter**2)
    return float(weights @ z / weights.sum()), weights


def _most_likely(z: np.ndarray, u: np.ndarray) -> float:
    """Return the scatter by restricted maximum likelihood.

    It is zero if the standard errors explain the scatter.
    """
    from scipy.optimize import minimize_scalar

    unit = float(np.std(z, ddof=1))

    def loss(scatter: float) -> float:
        mean, weights = _mean(z, u, scatter)
        return float(weights @ (z - mean) ** 2 - np.log(weights).sum() + np.log(weights.sum()))

    if unit == 0:
        return 0.0
    minimum: Any = minimize_scalar(lambda s: loss(s * unit), bounds=(0, 5), method="bounded", options={"xatol": 1e-9})
    return 0.0 if loss(0.0) <= minimum.fun else float(minimum.x) * unit


def _interval(z: np.ndarray, u: np.ndarray) -> tuple[float, float]:
    """Return the range of scatters with a plausible weighted chi^2."""
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
