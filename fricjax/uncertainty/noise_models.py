"""Comparison of the noise models of a fit by likelihood.

The likelihoods are those of the averaged residuals from which a fit estimates its noise, about forty per half-cycle,
at the optimum under each noise model. Compare them only with each other.
"""

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from ..errors import UsageError, nearest
from ..estimation.loss import Squares
from ..fitting import Fit
from ..fitting.assemble import assemble
from ..fitting.noise_weighting import NoiseWeighted, weigh_by_noise
from ..fitting.rows import rows_of
from ..fitting.settings import NOISE_MODELS
from ..fitting.solve import solve
from ..show import Cell, Report, Reported, Style, Table, axis_label, figure, plain, styled, uncertain
from .again import optimum, problem_of


class NoiseModelRow(NamedTuple):
    """One fit under one noise model.

    Attributes:
        name: name of the model.
        misfit: minus twice the logarithm of the likelihood, minus that of the best model.
        numbers: number of parameters of the noise model.
        aic, bic: criteria of Akaike and Schwarz, minus those of the best model.
        fit: the fit under the model.

    Examples:
        >>> from fricjax.uncertainty import NoiseModelRow
        >>> NoiseModelRow("white", 12.0, 1, 10.0, 4.0, None).numbers
        1
    """

    name: str
    misfit: float
    numbers: int
    aic: float
    bic: float
    fit: Any


@dataclasses.dataclass(frozen=True, eq=False)
class NoiseModels(Reported):
    """A fit under several noise models.

    Attributes:
        rows: one for each model, the smallest `bic` first.
        name: the parameter to show with its error.
        described: names of the models under which the fit describes its record.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fj.uncertainty.noise_models(fit).best.name
        'white'
    """

    rows: tuple[NoiseModelRow, ...]
    name: str

    @property
    def best(self) -> NoiseModelRow:
        """The model with the smallest `bic`."""
        return self.rows[0]

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the models under which the fit describes its record."""
        return tuple(row.name for row in self.rows if row.fit.described)

    def report(self) -> Report:
        """Return one row per model: criteria, and the value with its error."""
        rows = []
        for row in self.rows:
            scores = {name: getattr(row, name) for name in ("misfit", "aic", "bic")}
            misfit, aic, bic = (Cell(f"{score:.1f}", **{name: score}) for name, score in scores.items())
            value, std, unit = (of[self.name] for of in (row.fit.values, row.fit.std_errors, row.fit.units))
            fitted = Cell(uncertain(value, std, unit), value=value, std=std, unit=unit)
            rows.append([row.name, misfit, row.numbers, aic, bic, fitted, row.fit.status.split(":")[0]])
        heads = ["Noise model", "-2 ln L", "Numbers", "AIC", "BIC", self.name, "Status"]
        notes = [f"{row.name}: {NOISE_MODELS[row.name]}." for row in self.rows]
        data = {
            row.name: {
                "misfit": row.misfit,
                "numbers": row.numbers,
                "aic": row.aic,
                "bic": row.bic,
                "value": row.fit.values[self.name],
                "std_error": row.fit.std_errors[self.name],
                "status": row.fit.status,
            }
            for row in self.rows
        }
        return Report([Table(heads, rows, "Noise models, less the best")], notes=notes, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw the parameter with its interval under each model, in matplotlib.

        Values are relative to the best model, in units of its standard error.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure()
        axis, best, places = axes[0, 0], self.best.fit, np.arange(len(self.rows))
        unit = best.std_errors[self.name]
        shifts = [(row.fit.values[self.name] - best.values[self.name]) / unit for row in self.rows]
        halves = [np.ptp(row.fit.intervals[self.name]) / 2 / unit for row in self.rows]
        axis.errorbar(shifts, places, xerr=halves, fmt="o", capsize=4)
        axis.set_yticks(places, [f"{row.name} (BIC +{plain(row.bic, 3)})" for row in self.rows])
        axis.invert_yaxis()
        axis.set_xlabel(axis_label(f"{self.name} less that of the best model, in its standard errors", ""))
        return styled(drawing, style)


def noise_models(fit: Fit, name: str | None = None) -> NoiseModels:
    """Repeat a fit under each noise model.

    Args:
        fit: the fit; not one that was read from a file.
        name: parameter to show; None: mu, or the first one.

    Returns:
        The models, the smallest criterion of Schwarz first. A model that does not differ from white noise for these
        residuals is left out.

    Raises:
        UsageError: the fit has no optimum, is from a file or has a robust loss, or the parameter is unknown.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> [row.name for row in fj.uncertainty.noise_models(fit).rows][0]
        'white'
    """
    problem = problem_of(fit)
    name = name or ("mu" if "mu" in fit.names else fit.names[0])
    if name not in fit.names:
        raise UsageError(f"This fit has no {name!r}.{nearest(name, fit.names)} It has {', '.join(fit.names)}.")
    if not isinstance(problem.loss, Squares):
        raise UsageError("A robust loss is no likelihood: fit with loss='squares' to compare noise models.")
    absolute = fit.sigma_mode == "absolute"
    solution = solve(problem, problem.residual.space.coordinates(optimum(fit)))
    unit = 1.0 if absolute else solution.chi2 / problem.dof
    counts = []
    for model in NOISE_MODELS:
        counted = weigh_by_noise(dataclasses.replace(problem, noise=model), solution, absolute)
        if model == "white" or (model != "auto" and counted.went_on):
            gain, numbers = _of_size(counted, unit) if model == "white" else (counted.gain, counted.numbers)
            counts.append((model, counted.solution.chi2 / unit + gain, numbers, assemble(counted, fit.sigma_mode)))
    n, k = sum(row.series.t.size for row in rows_of(problem, solution.evaluation)), len(fit.names)
    criteria = np.array([[m, m + 2 * (k + q), m + (k + q) * np.log(n)] for _, m, q, _ in counts])
    criteria -= criteria.min(axis=0)
    rows = [NoiseModelRow(e[0], c[0], e[2], c[1], c[2], e[3]) for e, c in zip(counts, criteria.tolist(), strict=True)]
    return NoiseModels(tuple(sorted(rows, key=lambda row: row.bic)), name)


def _of_size(counted: NoiseWeighted, unit: float) -> tuple[float, int]:
    """Return the change of -2 ln L by a free noise size.

    The second number is the number of free sizes, 0 or 1.
    """
    if counted.variance == counted.scatter:
        return 0.0, 0
    gain = 0.0
    for row in rows_of(counted.problem, counted.solution.evaluation):
        squares_of_row, n = float(row.series.residual @ row.series.residual) / unit, row.series.t.size
        gain += n + n * np.log(squares_of_row / n) - squares_of_row
    return gain, 1
