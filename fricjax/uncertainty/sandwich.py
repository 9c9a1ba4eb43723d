"""Robust standard errors that do not depend on a noise model.

Noise changes the estimate by ``H^-1 g``, with the normal matrix ``H`` and the gradient ``g`` of the noise, a sum over
rows. The rows themselves give the variance of this sum, with the covariances of neighbouring rows. It is right for
correlated noise and for noise of varying size (Newey and West, Econometrica 55, 703, 1987). The largest lag follows
from an autoregression of each component (Andrews, Econometrica 59, 817, 1991). The method needs long records: for a
record of a few correlation times the errors are too small.
"""

import dataclasses
import math
from typing import Any

import numpy as np

from ..errors import UsageError
from ..estimation.colour import whitened
from ..estimation.loss import Squares
from ..fitting import Fit
from ..fitting.colours import colours_of, least_squares
from ..fitting.noise_weighting import weigh_by_noise
from ..fitting.rows import rows_of
from ..fitting.solve import solve
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, styled, uncertain
from .again import optimum, problem_of
from .resampling import Bootstrap

# Above this ratio to the standard error of the fit its noise model is in doubt. With a right noise model nine of ten
# ratios are between 1/1.5 and 1.5.
_DOUBTED = 1.5


@dataclasses.dataclass(frozen=True, eq=False)
class Sandwich(Reported):
    """Robust standard errors and those of a fit.

    Attributes:
        names: free parameters; `units`: by name.
        values, likelihood: values and standard errors of the fit, by name.
        std_errors: robust standard errors, by name; inf for an undetermined parameter.
        covariance: robust covariance, shape (p, p).
        memory: largest lag of the covariances of the gradient, for each run [s].
        bootstrap: scatter of the draws of a bootstrap, by name; empty without one.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> bool(0.5 < fj.uncertainty.sandwich(fit).ratios["mu"] < 1.5)
        True
    """

    names: tuple[str, ...]
    units: dict[str, str]
    values: dict[str, float]
    likelihood: dict[str, float]
    std_errors: dict[str, float]
    covariance: np.ndarray
    memory: tuple[float, ...]
    bootstrap: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def ratios(self) -> dict[str, float]:
        """Robust standard error over that of the fit; NaN if unknown."""
        pairs = ((name, self.std_errors[name], self.likelihood[name]) for name in self.names)
        return {name: std / known if known and math.isfinite(known) else math.nan for name, std, known in pairs}

    @property
    def doubted(self) -> tuple[str, ...]:
        """Parameters with a robust error significantly above that of the fit."""
        return tuple(name for name, ratio in self.ratios.items() if ratio > _DOUBTED)

    def report(self) -> Report:
        """Return the standard errors of each parameter."""
        ratios, rows = self.ratios, []
        for name in self.names:
            value, std, robust = self.values[name], self.likelihood[name], self.std_errors[name]
            cells = [Cell(uncertain(value, std), value=value), self.units[name], Cell(f"{std:.2g}", std=std)]
            cells += [Cell(f"{robust:.2g}", robust_std=robust), Cell(f"{ratios[name]:.2f}", ratio=ratios[name])]
            drawn = [Cell(f"{self.bootstrap[name]:.2g}", bootstrap_std=self.bootstrap[name])] if self.bootstrap else []
            rows.append([name, *cells, *drawn])
        heads = ["Parameter", "Value", "Unit", "Of the fit", "Robust", "Ratio"]
        heads += ["Bootstrap"] if self.bootstrap else []
        memory = ", ".join(f"{1e3 * each:.3g} ms" for each in self.memory)
        warnings = []
        if self.doubted:
            warnings.append(
                f"The robust errors of {', '.join(self.doubted)} are larger than those of the fit: its noise model "
                "does not hold. Compare noise models, or take noise='auto'."
            )
        names = ("names", "values", "likelihood", "std_errors", "ratios", "covariance", "memory", "bootstrap")
        data = {name: getattr(self, name) for name in names}
        facts = [("counted", f"covariances of the gradient up to {memory}")]
        return Report([Table(heads, rows, "Standard errors")], facts, warnings=warnings, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the ratios to the errors of the fit, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis, places = axes[0, 0], np.arange(len(self.names))
        height = 0.4 if self.bootstrap else 0.7
        axis.barh(places, [self.ratios[name] for name in self.names], height, label="robust")
        if self.bootstrap:
            others = [self.bootstrap[name] / self.likelihood[name] for name in self.names]
            axis.barh(places + height, others, height, label="bootstrap")
        axis.axvline(1.0, color="#000000", linestyle="--", linewidth=0.8)
        axis.set_yticks(places + (height / 2 if self.bootstrap else 0), self.names)
        axis.invert_yaxis()
        axis.set_xlabel(axis_label("Standard error over that of the fit", "1"))
        axis.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
        return styled(drawing, style)


def sandwich(fit: Fit, bootstrap: Bootstrap | None = None) -> Sandwich:
    """Return standard errors valid for heteroscedastic and autocorrelated noise.

    They are the errors of the estimate that the fit used: least squares for white noise, and generalised least squares
    for coloured noise. A fit with ``noise="white"`` thus gets errors that are valid for coloured noise too.

    Args:
        fit: the fit; not one that was read from a file.
        bootstrap: a bootstrap of the same fit, to show its scatter too.

    Returns:
        Both errors.

    Raises:
        UsageError: the fit has no optimum, is from a file, or has a robust loss.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fj.uncertainty.sandwich(fit).doubted
        ()
    """
    problem = problem_of(fit)
    if not isinstance(problem.loss, Squares):
        raise UsageError("The sandwich estimator is that of least squares: fit with loss='squares'.")
    absolute, p = fit.sigma_mode == "absolute", len(fit.names)
    solution = solve(problem, problem.residual.space.coordinates(optimum(fit)))
    counted = weigh_by_noise(problem, solution, absolute)
    problem, at = counted.problem, counted.solution
    rows = rows_of(problem, at.evaluation)
    seen = colours_of(problem, at, rows, absolute) if counted.numbers else []
    weighed = [whitened(row.series, colour) for row, colour in seen] or [
        (row.series.residual, row.series.slopes) for row in rows
    ]
    shape, *_ = least_squares(problem, at, weighed)
    slope, values = np.asarray(at.derived.slope), {name: fit.values[name] for name in fit.names}
    middle, memory = np.zeros((p, p)), []
    for (residual, slopes), row in zip(weighed, rows, strict=True):
        long_run, lag = _long_run(slopes[:, :p] * residual[:, None])
        middle, memory = middle + long_run, [*memory, lag * row.samples * row.interval]
    n = sum(residual.size for residual, _ in weighed)
    covariance = shape.inverse @ middle @ shape.inverse * np.outer(slope, slope) * n / max(n - p, 1)
    lost = ~np.isfinite(np.diag(fit.covariance))
    covariance[lost, lost] = np.inf
    errors = dict(zip(fit.names, np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(), strict=True))
    units, scatter = {name: fit.units[name] for name in fit.names}, {} if bootstrap is None else bootstrap.std
    return Sandwich(fit.names, units, values, dict(fit.std_errors), errors, covariance, tuple(memory), scatter)


def _long_run(gradients: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the covariance of a sum of rows and the largest lag.

    The covariance has the shape (p, p). The weights fall linearly with the lag, which keeps it positive.
    """
    n = gradients.shape[0]
    before, after = gradients[:-1], gradients[1:]
    power = np.sum(before**2, axis=0)
    memory = np.sum(before * after, axis=0) / np.where(power > 0, power, 1.0)
    memory = np.clip(memory, -0.97, 0.97)
    size = np.var(after - memory * before, axis=0) ** 2
    weigh = np.divide(1.0, size.clip(np.finfo(float).tiny), where=size > 0, out=np.zeros(size.size))
    # The components have different units, so each is weighted by the inverse square of its variance.
    above = np.sum(weigh * size * 4 * memory**2 / ((1 - memory) ** 6 * (1 + memory) ** 2))
    below = np.sum(weigh * size / (1 - memory) ** 4)
    lag = min(math.ceil(1.1447 * (above / max(below, np.finfo(float).tiny) * n) ** (1 / 3)), n // 4)
    total = gradients.T @ gradients
    for k in range(1, lag + 1):
        product = gradients[k:].T @ gradients[:-k]
        total += (1 - k / (lag + 1)) * (product + product.T)
    return total, lag
