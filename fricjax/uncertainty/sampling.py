"""Posterior of the parameters of a fit, by Hamiltonian Monte Carlo.

The No-U-Turn sampler of numpyro (Hoffman and Gelman, JMLR 15, 1593, 2014; Phan et al., arXiv:1912.11554) starts at the
optimum. In its coordinates the covariance of the fit is the identity, which makes sampling fast for a nearly normal
posterior. The prior is flat in the coordinates of the fit: in the value, or in the logarithm of a positive parameter.
Priors and bounds of the fit are kept.
"""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import UsageError, needed
from ..estimation.loss import Squares
from ..fitting import Fit
from ..fitting.mesh import with_mesh
from ..fitting.residual import Residual
from ..show import Cell, Report, Table, interval, uncertain
from ..show.working import working
from .again import optimum, problem_of, squares
from .draws import AbstractDraws

# Fewest draws per chain for a check of convergence.
_FEWEST = 100
# Largest R-hat of converged chains (Vehtari et al., Bayesian Anal. 16, 667, 2021).
_MET = 1.01


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior(AbstractDraws):
    """Draws from the posterior of a fit.

    Attributes:
        names: free parameters; `units`: by name.
        sample: draws, shape (chains, draws, p).
        values, std_errors: values and standard errors of the fit, by name.
        r_hat: split R-hat of each parameter; `effective`: its effective number of draws.
        divergences: number of divergent transitions of the sampler; zero for a valid posterior.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> posterior = fj.uncertainty.posterior(fit, 100, chains=2, warmup=100)
        >>> posterior.divergences, bool(0.6 < posterior.std["mu"] / fit.std_errors["mu"] < 1.6)
        (0, True)
    """

    r_hat: dict[str, float]
    effective: dict[str, float]
    divergences: int

    @property
    def good(self) -> np.ndarray:
        """The draws of all chains, shape (n, p)."""
        return self.sample.reshape(-1, len(self.names))

    @property
    def converged(self) -> bool:
        """True if the chains have converged without divergences."""
        return self.divergences == 0 and all(each <= _MET for each in self.r_hat.values())

    def to_datatree(self) -> Any:
        """Return the draws as a DataTree of ArviZ."""
        arviz = needed("A DataTree", "arviz_base", "bayes")
        return arviz.from_dict({"posterior": {name: self.sample[:, :, i] for i, name in enumerate(self.names)}})

    def report(self) -> Report:
        """Return mean, standard deviation, interval and convergence of each parameter."""
        std = self.std
        means = dict(zip(self.names, self.good.mean(axis=0).tolist(), strict=True))
        rows = []
        for name, (low, high) in self.intervals().items():
            ratio, r_hat, effective = std[name] / self.std_errors[name], self.r_hat[name], self.effective[name]
            value = Cell(uncertain(means[name], std[name]), value=means[name], std=std[name])
            between, compared = Cell(interval(low, high), low=low, high=high), Cell(f"{ratio:.2f}", ratio=ratio)
            met = [Cell(f"{r_hat:.3f}", r_hat=r_hat), Cell(f"{effective:.0f}", effective=effective)]
            rows.append([name, value, self.units[name], between, compared, *met])
        heads = ["Parameter", "Mean (standard deviation)", "Unit", "95 % interval"]
        heads += ["Of the standard error", "R-hat", "Effective draws"]
        chains, draws, _ = self.sample.shape
        facts = [("draws", f"{chains} chains of {draws}"), ("divergences", f"{self.divergences}")]
        warnings = []
        if not self.converged:
            warnings.append(
                f"The chains have not converged (R-hat above {_MET}), or draws have diverged: take more draws, or "
                "bound the parameters that the record does not determine."
            )
        names = ("names", "values", "std_errors", "r_hat", "effective", "divergences", "std", "converged")
        data = {name: getattr(self, name) for name in names} | {"intervals": self.intervals(), "means": means}
        return Report([Table(heads, rows, "Posterior")], facts, warnings=warnings, data=data)


def _without_fillers(residual: Residual) -> Residual:
    """Return the residual without samples of zero weight.

    Such samples make runs of different length share one compiled program, but they would slow down the sampler.
    """
    runs = [(run, np.asarray(run.weight) > 0) for run in residual.runs]
    kept = (run._replace(t=run.t[at], x=run.x[at], weight=run.weight[at]) for run, at in runs)
    # A traced function must close over arrays of JAX, not of NumPy.
    caught = lambda leaf: jnp.asarray(leaf) if isinstance(leaf, np.ndarray) else leaf
    return jax.tree.map(caught, residual._replace(runs=tuple(kept)))


@working("Drawing from the posterior")
def posterior(fit: Fit, draws: int = 500, *, chains: int = 4, warmup: int = 300, seed: int = 0) -> Posterior:
    """Draw the parameters of a fit from their posterior distribution.

    Args:
        fit: the fit; not one that was read from a file.
        draws: number of draws of each chain after the warm-up.
        chains: number of chains; each has a different start near the optimum.
        warmup: number of draws to discard, in which the sampler adapts its step size.
        seed: seed of the generator; the same seed gives the same numbers.

    Returns:
        The draws with R-hat, effective numbers and divergences. Coloured noise enters as one factor: the factor by
        which it enlarges the covariance of the fit.

    Raises:
        UsageError: numpyro is not installed (the message names the package to install), or the fit has no optimum, is
            from a file, has a robust loss or an undetermined parameter.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fj.uncertainty.posterior(fit, 100, chains=2, warmup=100).sample.shape
        (2, 100, 6)
    """
    diagnostics, infer = (needed("A posterior", f"numpyro.{name}", "bayes") for name in ("diagnostics", "infer"))
    problem, values = problem_of(fit), optimum(fit)
    if not isinstance(problem.loss, Squares):
        raise UsageError("A robust loss is no likelihood: fit with loss='squares' for a posterior.")
    if draws < _FEWEST or chains < 2:
        raise UsageError(f"Take {_FEWEST} draws and two chains at least, to check the convergence.")
    slope = np.asarray(problem.residual.space.slope(problem.residual.space.coordinates(values)))
    covariance = np.asarray(fit.covariance) / np.outer(slope, slope)
    if not np.all(np.isfinite(covariance)):
        lost = ", ".join(name for name, std in fit.std_errors.items() if not np.isfinite(std))
        raise UsageError(f"The record does not determine {lost}. Fix it, or give it a prior, for a posterior.")
    (least,) = squares([problem], [problem.residual.space.coordinates(values)])
    sign_white, white = np.linalg.slogdet(least.shape.inverse)
    _, counted = np.linalg.slogdet(covariance)
    # Effect of the colour of the noise on the covariance, as one factor of chi^2.
    unit = math.exp((white - counted) / values.size) if sign_white > 0 else 1.0
    y, root = least.y[: values.size], np.linalg.cholesky(covariance)
    residual, limits = with_mesh(_without_fillers(problem.condensed), y), problem.limits

    def potential(z: Any) -> Any:
        at = y + root @ z
        inside = jnp.all((at > limits.lower) & (at < limits.upper))
        return jnp.where(inside, unit / 2 * jnp.sum(residual(jnp.clip(at, limits.lower, limits.upper)) ** 2), jnp.inf)

    key, start = jax.random.split(jax.random.key(seed))
    # Loops over half-cycles have forward derivatives only, which are fast enough for few parameters.
    kernel = infer.NUTS(potential_fn=potential, forward_mode_differentiation=True)
    mcmc = infer.MCMC(
        kernel, num_warmup=warmup, num_samples=draws, num_chains=chains, chain_method="vectorized", progress_bar=False
    )
    mcmc.run(key, init_params=jax.random.normal(start, (chains, y.size)), extra_fields=("diverging",))
    at = y + np.asarray(mcmc.get_samples(group_by_chain=True)) @ root.T
    space = problem.residual.space
    sample = np.asarray(jax.vmap(jax.vmap(space.values))(jnp.asarray(at))) + problem.origins
    # With coloured noise the fit is not at the least-squares optimum.
    sample += values - np.asarray(space.values(y))
    names = fit.names
    met, effective = diagnostics.split_gelman_rubin(at), diagnostics.effective_sample_size(at)
    return Posterior(
        names,
        {name: fit.units[name] for name in names},
        sample,
        {name: fit.values[name] for name in names},
        dict(fit.std_errors),
        dict(zip(names, np.asarray(met).tolist(), strict=True)),
        dict(zip(names, np.asarray(effective).tolist(), strict=True)),
        int(np.sum(mcmc.get_extra_fields()["diverging"])),
    )
