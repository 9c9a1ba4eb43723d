"""Posterior of a coefficient that scatters from run to run.

Each run has its own coefficient and standard error. The errors of the rig change all runs together,

    mu_i ~ N(mean, scatter^2),   y_i = mu_i + sum_k c_ik z_k + u_i,   z_k ~ N(0, 1).

The coefficients of the runs are integrated out analytically, because they are normal given the rest. A sampler that
moved them would mix badly: the standard error of a run is about a thousandth of the scatter. They are drawn from their
conditional normal distribution afterwards (Gelman et al., Bayesian Data Analysis, 2013, 5.4). The sampler is that of
:mod:`fricjax.uncertainty.sampling`.
"""

import dataclasses
import functools
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import UsageError, nearest, needed
from ..fitting.batch_result import BatchFit
from ..rig import Measured
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, interval, styled, uncertain

# Fewest runs for a scatter, and largest R-hat of converged chains, as for the posterior of one fit.
_FEWEST, _MET = 3, 1.01
# Width of the default priors of mean and scatter, in units of the scatter of the values. Such priors have no effect.
_WIDE = 100.0
# The coefficients of the runs need another seed than the chains.
_OTHER_SEED = 1


@dataclasses.dataclass(frozen=True, eq=False)
class Hierarchical(Reported):
    """Draws from the posterior of a coefficient over runs.

    Attributes:
        name: name of the coefficient; `unit`: unit of the coefficient and of its scatter.
        mean, scatter: draws of the population's mean and standard deviation, shape (chains, draws).
        inputs: draws of the errors of the rig's inputs, in units of their uncertainties, by name, of that shape.
        runs: draws of the coefficient of each run, shape (chains, draws, runs).
        values, std_errors: fitted values and standard errors of the runs, shape (runs,).
        r_hat, effective: split R-hat and effective number of draws, by name.
        divergences: number of divergent transitions of the sampler.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> values, errors = np.array([0.0502, 0.0497, 0.0505, 0.0499]), np.full(4, 1e-6)
        >>> found = fj.uncertainty.hierarchical((values, errors), draws=200, chains=2)
        >>> found.mean.shape, bool(0.049 < found.mean.mean() < 0.051)
        ((2, 200), True)
    """

    name: str
    unit: str
    mean: np.ndarray
    scatter: np.ndarray
    inputs: dict[str, np.ndarray]
    runs: np.ndarray
    values: np.ndarray
    std_errors: np.ndarray
    r_hat: dict[str, float]
    effective: dict[str, float]
    divergences: int

    @property
    def converged(self) -> bool:
        """True if the chains have converged without divergences."""
        return self.divergences == 0 and all(each <= _MET for each in self.r_hat.values())

    def _draws(self) -> dict[str, np.ndarray]:
        return {"mean": self.mean, "scatter": self.scatter, **self.inputs}

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return intervals of mean, scatter and errors of inputs.

        They leave out equal fractions of the draws at both ends.
        """
        ends = {name: np.quantile(each, [(1 - level) / 2, (1 + level) / 2]) for name, each in self._draws().items()}
        return {name: (float(low), float(high)) for name, (low, high) in ends.items()}

    def to_datatree(self) -> Any:
        """Return the draws and the observed values as a DataTree of ArviZ."""
        from_dict = needed("A DataTree", "arviz_base", "bayes").from_dict
        drawn = {self.name: self.mean, f"{self.name}_scatter": self.scatter, f"{self.name}_of_run": self.runs}
        observed = {self.name: self.values}
        return from_dict({"posterior": drawn | self.inputs, "observed_data": observed})

    def report(self) -> Report:
        """Return mean, scatter and errors of the rig's inputs with their intervals."""
        ends, rows = self.intervals(), []
        for name, draws in self._draws().items():
            label = {"mean": f"mean of {self.name}", "scatter": "scatter from run to run"}.get(name, f"error of {name}")
            unit = "its uncertainty" if name in self.inputs else self.unit
            mean, std, (low, high) = float(draws.mean()), float(draws.std()), ends[name]
            value = Cell(uncertain(mean, std), value=mean, std=std)
            between = Cell(interval(low, high), low=low, high=high)
            met = Cell(f"{self.r_hat[name]:.3f}", r_hat=self.r_hat[name])
            effective = Cell(f"{self.effective[name]:.0f}", effective=self.effective[name])
            rows.append([label, value, unit, between, met, effective])
        heads = ["Quantity", "Mean (standard deviation)", "Unit", "95 % interval", "R-hat", "Effective draws"]
        chains, draws = self.mean.shape
        facts = [("runs", f"{self.values.size}"), ("draws", f"{chains} chains of {draws}, {self.divergences} diverged")]
        apart = "The chains have not converged: take more draws, or give a prior of the scatter."
        warnings = [] if self.converged else [apart]
        data = {"intervals": ends, "r_hat": self.r_hat, "effective": self.effective, "divergences": self.divergences}
        data |= {name: {"mean": float(each.mean()), "std": float(each.std())} for name, each in self._draws().items()}
        return Report([Table(heads, rows, "Posterior over runs")], facts, warnings=warnings, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the runs, and mean and scatter of the population, in matplotlib.

        The right half shows the draws of mean and scatter.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(1, 2)
        left, right = axes[0]
        numbers, middle = np.arange(self.values.size), float(self.mean.mean())
        left.errorbar(numbers, self.values, yerr=self.std_errors, fmt="o", markersize=4)
        reach = float(self.scatter.mean())
        left.axhspan(middle - reach, middle + reach, alpha=0.15, color="#D55E00", linewidth=0, label="scatter")
        left.axhline(middle, color="#D55E00", label="mean")
        left.legend()
        left.set_xlabel(axis_label("Run", ""))
        left.set_ylabel(axis_label(self.name, self.unit or "1"))
        right.plot(self.mean.ravel(), self.scatter.ravel(), ".", markersize=2, alpha=0.4)
        right.locator_params(axis="x", nbins=4)
        right.set_xlabel(axis_label(f"Mean of {self.name}", self.unit or "1"))
        right.set_ylabel(axis_label("Scatter from run to run", self.unit or "1"))
        return styled(drawing, style)


def hierarchical(
    runs: BatchFit | tuple[np.ndarray, np.ndarray],
    name: str = "mu",
    *,
    mean: Measured | tuple[float, float] | None = None,
    scatter: float | None = None,
    draws: int = 500,
    chains: int = 4,
    warmup: int = 500,
    seed: int = 0,
) -> Hierarchical:
    """Draw mean and scatter of a coefficient over runs from their posterior.

    Args:
        runs: a batch of fits, or values and standard errors, each of shape (runs,). Only the described fits of a batch
            are used. For a batch that was fitted with a rig, the errors of the rig's inputs are drawn too: from their
            stated uncertainties, with one error for all runs.
        name: name of the coefficient.
        mean: normal prior of the population's mean, as a pair or a `Measured`; None: a flat one.
        scatter: scale of the half-normal prior of the scatter; None: a flat one.
        draws: number of draws of each chain after the warm-up.
        chains: number of chains.
        warmup: number of draws to discard, in which the sampler adapts its step size.
        seed: seed of the generator; the same seed gives the same numbers.

    Returns:
        The draws.

    Raises:
        UsageError: numpyro is not installed, there are fewer than three runs, or the coefficient is unknown.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> values, errors = np.array([0.0502, 0.0497, 0.0505, 0.0499]), np.full(4, 1e-6)
        >>> fj.uncertainty.hierarchical((values, errors), scatter=1e-3, draws=200, chains=2).divergences
        0
    """
    y, u, unit, common = _observed(runs, name)
    if y.size < _FEWEST:
        raise UsageError(f"A scatter from run to run needs at least three fitted runs, got {y.size}.")
    if scatter is not None and not scatter > 0:
        raise UsageError(f"The prior of the scatter needs a positive scale, got {scatter:g}.")
    if chains < 2 or draws < 1:
        raise UsageError("Take two chains at least, to check their convergence.")
    diagnostics = needed("A posterior", "numpyro.diagnostics", "bayes")
    size = max(float(np.std(y, ddof=1)), float(np.median(u)))
    matrix = np.reshape(list(common.values()), (-1, y.size)).T
    most = _WIDE * float(np.hypot(size, np.linalg.norm(matrix, axis=1).max(initial=0.0)))
    stated = (mean.value, mean.std) if isinstance(mean, Measured) else mean
    expected, width = (float(y.mean()), most) if stated is None else stated
    observed = {"y": (y - y.mean()) / size, "u": u / size, "common": matrix / size}
    priors = {"expected": (expected - y.mean()) / size, "width": width / size}
    priors["scale"] = _WIDE if scatter is None else scatter / size
    sampler = _sampler(matrix.shape[1], draws, chains, warmup)
    sampler.run(jax.random.key(seed), **observed, **priors, extra_fields=("diverging",))
    drawn = {key: np.asarray(each) for key, each in sampler.get_samples(group_by_chain=True).items()}
    middle, spread, z = y.mean() + size * drawn["mean"], size * drawn["scatter"], drawn["z"]
    inputs = {source: z[:, :, k] for k, source in enumerate(common)}
    every = {"mean": middle, "scatter": spread, **inputs}
    met = {key: float(diagnostics.split_gelman_rubin(each)) for key, each in every.items()}
    effective = {key: float(diagnostics.effective_sample_size(each)) for key, each in every.items()}
    left = y - z @ matrix.T
    astray = int(np.sum(sampler.get_extra_fields()["diverging"]))
    of_runs = _of_runs(left, u, middle, spread, seed)
    return Hierarchical(name, unit, middle, spread, inputs, of_runs, y, u, met, effective, astray)


def _observed(runs: Any, name: str) -> tuple[np.ndarray, np.ndarray, str, dict[str, np.ndarray]]:
    """Return values, standard errors, unit and contributions of the inputs.

    The arrays have one element per valid run.
    """
    if not isinstance(runs, BatchFit):
        y, u = (np.asarray(each, float) for each in runs)
        if y.shape != u.shape or y.ndim != 1 or not np.all(u > 0):
            raise UsageError("Give values and positive standard errors of the runs, two lists of one length.")
        return y, u, "", {}
    if name not in runs.names:
        raise UsageError(f"These fits have no {name!r}.{nearest(name, runs.names)} They have {', '.join(runs.names)}.")
    used = runs.described & np.isfinite(runs.std_errors[name])
    common = {source: each[used] for source, each in runs.contributions[name].items()}
    return runs.values[name][used], runs.std_errors[name][used], runs.units[name], common


@functools.lru_cache(maxsize=8)
def _sampler(inputs: int, draws: int, chains: int, warmup: int) -> Any:
    """Return a sampler with one compiled program per size of data."""
    import numpyro
    from numpyro import distributions
    from numpyro.infer import MCMC, NUTS

    def model(y: Any, u: Any, common: Any, expected: Any, width: Any, scale: Any) -> None:
        # The runs determine the sum of the mean and the errors of the rig, but hardly the two alone. The sampler moves
        # the sum, and the mean is the sum minus the errors of the rig.
        level = numpyro.sample("level", distributions.ImproperUniform(distributions.constraints.real, (), ()))
        spread = numpyro.sample("scatter", distributions.HalfNormal(scale))
        z = numpyro.sample("z", distributions.Normal(0.0, 1.0).expand([inputs]).to_event(1))
        alike = jnp.mean(common, axis=0)
        middle = numpyro.deterministic("mean", level - alike @ z)
        numpyro.factor("prior", distributions.Normal(expected, width).log_prob(middle))
        numpyro.sample("y", distributions.Normal(level + (common - alike) @ z, jnp.hypot(spread, u)), obs=y)

    kernel = NUTS(model, dense_mass=True, target_accept_prob=0.95)
    settings = {"chain_method": "vectorized", "progress_bar": False, "jit_model_args": True}
    return MCMC(kernel, num_warmup=warmup, num_samples=draws, num_chains=chains, **settings)


def _of_runs(left: np.ndarray, u: np.ndarray, middle: np.ndarray, spread: np.ndarray, seed: int) -> np.ndarray:
    """Draw the coefficient of each run given the population.

    The result has the shape (chains, draws, runs).
    """
    known, wide = 1 / u**2, 1 / np.maximum(spread, math.sqrt(np.finfo(float).tiny))[:, :, None] ** 2
    weight = known + wide
    normal = np.random.default_rng([seed, _OTHER_SEED]).standard_normal(left.shape)
    return (left * known + middle[:, :, None] * wide) / weight + normal / np.sqrt(weight)
