"""The posterior over runs: a coefficient that scatters from run to run, its mean, and what the rig adds to all runs.

Each run has its own coefficient and tells it with its own standard error, and the errors of the rig move all together,

    mu_i ~ N(mean, scatter^2),   y_i = mu_i + sum_k c_ik z_k + u_i,   z_k ~ N(0, 1).

The single coefficients are integrated out by hand, for they are normal given the rest: a run is known a thousand times
as well as runs scatter, and a sampler that moved them would hardly move. They are drawn from that normal afterwards
(Gelman et al., Bayesian Data Analysis, 2013, 5.4). The sampler is that of :mod:`fricjax.uncertainty.sampling`.
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
from ..show import Report, Reported, Style, Table, axis_label, figure, interval, styled, uncertain

# Fewest runs of which a scatter is told, and R-hat of chains that have met, as for the posterior of one fit.
_FEWEST, _MET = 3, 1.01
# How wide the priors of mean and scatter are where none are given, in units of the values' own scatter: they then tell
# nothing.
_WIDE = 100.0
# The seed of the coefficients of the runs is another one than that of the chains.
_OTHER_SEED = 1


@dataclasses.dataclass(frozen=True, eq=False)
class Hierarchical(Reported):
    """Draws from the posterior of a coefficient over runs.

    Attributes:
        name: of the coefficient; `unit`: of it and its scatter.
        mean, scatter: draws of the population's mean and standard deviation, shape (chains, draws).
        inputs: draws of the errors of the rig's inputs, in units of their uncertainties, by name, each of that shape.
        runs: draws of the coefficient of each run, shape (chains, draws, runs).
        values, std_errors: of the runs as they were fitted, shape (runs,).
        r_hat, effective: split R-hat and effective number of draws, by name.
        divergences: number of draws at which the sampler went astray.

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
        """Whether the chains have met, and no draw went astray."""
        return self.divergences == 0 and all(each <= _MET for each in self.r_hat.values())

    def _draws(self) -> dict[str, np.ndarray]:
        return {"mean": self.mean, "scatter": self.scatter, **self.inputs}

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Intervals of mean, scatter and errors of inputs that leave out the same part of the draws at both ends."""
        ends = {name: np.quantile(each, [(1 - level) / 2, (1 + level) / 2]) for name, each in self._draws().items()}
        return {name: (float(low), float(high)) for name, (low, high) in ends.items()}

    def to_datatree(self) -> Any:
        """The draws as a DataTree of ArviZ, with the observed values, for its plots and diagnostics."""
        from_dict = needed("A DataTree", "arviz_base", "bayes").from_dict
        drawn = {self.name: self.mean, f"{self.name}_scatter": self.scatter, f"{self.name}_of_run": self.runs}
        observed = {self.name: self.values}
        return from_dict({"posterior": drawn | self.inputs, "observed_data": observed})

    def report(self) -> Report:
        """Mean, scatter and the errors of the rig's inputs with their intervals."""
        ends, rows = self.intervals(), []
        for name, draws in self._draws().items():
            label = {"mean": f"mean of {self.name}", "scatter": "scatter from run to run"}.get(name, f"error of {name}")
            unit = "its uncertainty" if name in self.inputs else self.unit
            met = [f"{self.r_hat[name]:.3f}", f"{self.effective[name]:.0f}"]
            rows.append([label, uncertain(float(draws.mean()), float(draws.std())), unit, interval(*ends[name]), *met])
        heads = ["Quantity", "Mean (standard deviation)", "Unit", "95 % interval", "R-hat", "Effective draws"]
        chains, draws = self.mean.shape
        facts = [("runs", f"{self.values.size}"), ("draws", f"{chains} chains of {draws}, {self.divergences} diverged")]
        apart = "The chains have not met: take more draws, or give a prior of the scatter."
        warnings = [] if self.converged else [apart]
        data = {"intervals": ends, "r_hat": self.r_hat, "effective": self.effective, "divergences": self.divergences}
        data |= {name: {"mean": float(each.mean()), "std": float(each.std())} for name, each in self._draws().items()}
        return Report([Table(heads, rows, "Posterior over runs")], facts, warnings=warnings, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Runs with their errors and the population's mean and scatter; draws of both; a matplotlib figure.

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
        runs: a batch of fits, of which the converged ones count, or values and standard errors, each of shape (runs,).
            With a batch that was fitted with a rig the errors of its inputs are drawn too, by the priors that the rig
            states, the same in all runs.
        name: of the coefficient.
        mean: prior of the population's mean, as a pair or a `Measured`; None: one that tells nothing.
        scatter: scale of the half-normal prior of the scatter; None: one that tells nothing.
        draws: number of draws of each chain, behind `warmup` draws in which the sampler finds its step.
        chains: number of chains.
        warmup: draws that are thrown away.
        seed: of the generator; the same seed gives the same numbers.

    Returns:
        The draws.

    Raises:
        UsageError: numpyro is not installed, fewer than three runs, or an unknown coefficient.

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
        raise UsageError("Take two chains at least, to tell whether they have met.")
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
    """Values and standard errors of the runs that count, the unit, and what each input of a rig adds to them."""
    if not isinstance(runs, BatchFit):
        y, u = (np.asarray(each, float) for each in runs)
        if y.shape != u.shape or y.ndim != 1 or not np.all(u > 0):
            raise UsageError("Give values and positive standard errors of the runs, two lists of one length.")
        return y, u, "", {}
    if name not in runs.names:
        raise UsageError(f"These fits have no {name!r}.{nearest(name, runs.names)} They have {', '.join(runs.names)}.")
    used = runs.converged & np.isfinite(runs.std_errors[name])
    common = {source: each[used] for source, each in runs.contributions[name].items()}
    return runs.values[name][used], runs.std_errors[name][used], runs.units[name], common


@functools.lru_cache(maxsize=8)
def _sampler(inputs: int, draws: int, chains: int, warmup: int) -> Any:
    """The sampler, whose compiled programs serve all data of one size."""
    import numpyro
    from numpyro import distributions
    from numpyro.infer import MCMC, NUTS

    def model(y: Any, u: Any, common: Any, expected: Any, width: Any, scale: Any) -> None:
        # What the runs show is the mean with the errors of the rig, which stand for each other to parts in a thousand:
        # the sampler moves what is seen, and the mean is what is left of it.
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
    """Draws of the coefficient of each run, given those of the rest, shape (chains, draws, runs)."""
    known, wide = 1 / u**2, 1 / np.maximum(spread, math.sqrt(np.finfo(float).tiny))[:, :, None] ** 2
    weight = known + wide
    normal = np.random.default_rng([seed, _OTHER_SEED]).standard_normal(left.shape)
    return (left * known + middle[:, :, None] * wide) / weight + normal / np.sqrt(weight)
