"""The posterior: fitted parameters drawn from their distribution given the record, by Hamiltonian Monte Carlo.

The No-U-Turn sampler of numpyro (Hoffman and Gelman, JMLR 15, 1593, 2014; Phan et al., arXiv:1912.11554) starts at the
optimum, in coordinates in which the covariance of the fit is the identity, so that where the posterior is normal it
moves as fast as it can. The prior is flat in the coordinates of the fit: in the value, or in the logarithm of what is
positive; priors and bounds of the fit are kept.
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
from ..show import Report, Table, interval, uncertain
from ..show.working import working
from .again import optimum, problem_of, squares
from .draws import AbstractDraws

# Fewest draws of a chain of which its convergence can be told.
_FEWEST = 100
# Largest R-hat of chains that have met (Vehtari et al., Bayesian Anal. 16, 667, 2021).
_MET = 1.01


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior(AbstractDraws):
    """Draws from the posterior of a fit.

    Attributes:
        names: free parameters; `units`: by name.
        sample: draws, shape (chains, draws, p).
        values, std_errors: those of the fit, by name.
        r_hat: split R-hat of each parameter; `effective`: its effective number of draws.
        divergences: number of draws at which the sampler went astray; none in a posterior that it can follow.

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
        """Whether the chains have met, and no draw went astray."""
        return self.divergences == 0 and all(each <= _MET for each in self.r_hat.values())

    def to_datatree(self) -> Any:
        """The draws as a DataTree of ArviZ, for its plots and diagnostics."""
        arviz = needed("A DataTree", "arviz_base", "bayes")
        return arviz.from_dict({"posterior": {name: self.sample[:, :, i] for i, name in enumerate(self.names)}})

    def report(self) -> Report:
        """Mean, standard deviation and interval of each parameter, and how well the chains have met."""
        std = self.std
        means = dict(zip(self.names, self.good.mean(axis=0).tolist(), strict=True))
        rows = []
        for name, ends in self.intervals().items():
            met = [f"{std[name] / self.std_errors[name]:.2f}", f"{self.r_hat[name]:.3f}", f"{self.effective[name]:.0f}"]
            rows.append([name, uncertain(means[name], std[name]), self.units[name], interval(*ends), *met])
        heads = ["Parameter", "Mean (standard deviation)", "Unit", "95 % interval"]
        heads += ["Of the standard error", "R-hat", "Effective draws"]
        chains, draws, _ = self.sample.shape
        facts = [("draws", f"{chains} chains of {draws}"), ("divergences", f"{self.divergences}")]
        warnings = []
        if not self.converged:
            warnings.append(
                f"The chains have not met (R-hat above {_MET}), or draws have diverged: take more draws, or bound what "
                "the record leaves open."
            )
        names = ("names", "values", "std_errors", "r_hat", "effective", "divergences", "std", "converged")
        data = {name: getattr(self, name) for name in names} | {"intervals": self.intervals(), "means": means}
        return Report([Table(heads, rows, "Posterior")], facts, warnings=warnings, data=data)


def _without_fillers(residual: Residual) -> Residual:
    """The residual without samples that count for nothing: they share compilations, but here each is paid for often."""
    runs = [(run, np.asarray(run.weight) > 0) for run in residual.runs]
    kept = (run._replace(t=run.t[at], x=run.x[at], weight=run.weight[at]) for run, at in runs)
    # Nothing else makes arrays of what a traced function has caught.
    caught = lambda leaf: jnp.asarray(leaf) if isinstance(leaf, np.ndarray) else leaf
    return jax.tree.map(caught, residual._replace(runs=tuple(kept)))


@working("Drawing from the posterior")
def posterior(fit: Fit, draws: int = 500, *, chains: int = 4, warmup: int = 300, seed: int = 0) -> Posterior:
    """Draw the parameters of a fit from their posterior distribution.

    Args:
        fit: the fit; not one that was read from a file.
        draws: number of draws of each chain, behind `warmup` draws in which the sampler finds its step.
        chains: number of chains, each with another start about the optimum.
        warmup: draws that are thrown away.
        seed: of the generator; the same seed gives the same numbers.

    Returns:
        The draws with R-hat, effective numbers and divergences. Noise that is not white counts by the one factor by
        which it makes the covariance of the fit larger.

    Raises:
        UsageError: numpyro is not installed, which the sentence says how to do; a fit without an optimum, from a
            file, with a robust loss or an undetermined parameter.

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
        raise UsageError(f"Take {_FEWEST} draws and two chains at least, to tell whether the chains have met.")
    slope = np.asarray(problem.residual.space.slope(problem.residual.space.coordinates(values)))
    covariance = np.asarray(fit.covariance) / np.outer(slope, slope)
    if not np.all(np.isfinite(covariance)):
        lost = ", ".join(name for name, std in fit.std_errors.items() if not np.isfinite(std))
        raise UsageError(f"The record does not determine {lost}. Fix it, or give it a prior, for a posterior.")
    (least,) = squares([problem], [problem.residual.space.coordinates(values)])
    sign_white, white = np.linalg.slogdet(least.shape.inverse)
    _, counted = np.linalg.slogdet(covariance)
    # What the colour of the noise makes of the covariance, as one factor of the squares.
    unit = math.exp((white - counted) / values.size) if sign_white > 0 else 1.0
    y, root = least.y[: values.size], np.linalg.cholesky(covariance)
    residual, limits = with_mesh(_without_fillers(problem.condensed), y), problem.limits

    def potential(z: Any) -> Any:
        at = y + root @ z
        inside = jnp.all((at > limits.lower) & (at < limits.upper))
        return jnp.where(inside, unit / 2 * jnp.sum(residual(jnp.clip(at, limits.lower, limits.upper)) ** 2), jnp.inf)

    key, start = jax.random.split(jax.random.key(seed))
    # Loops over half-cycles have derivatives forwards only, and the parameters are few.
    kernel = infer.NUTS(potential_fn=potential, forward_mode_differentiation=True)
    mcmc = infer.MCMC(
        kernel, num_warmup=warmup, num_samples=draws, num_chains=chains, chain_method="vectorized", progress_bar=False
    )
    mcmc.run(key, init_params=jax.random.normal(start, (chains, y.size)), extra_fields=("diverging",))
    at = y + np.asarray(mcmc.get_samples(group_by_chain=True)) @ root.T
    space = problem.residual.space
    sample = np.asarray(jax.vmap(jax.vmap(space.values))(jnp.asarray(at))) + problem.origins
    # Where noise is coloured the fit is not at the least squares.
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
