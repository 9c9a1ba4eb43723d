"""Results of the routes: coefficients with their uncertainties and residuals."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..estimation.covariance import correlation
from ..rig import Measured
from ..show import (
    Cell,
    Report,
    Reported,
    Style,
    Table,
    axis_label,
    display_unit,
    engineering,
    figure,
    interval,
    plain,
    styled,
    uncertain,
)


def coefficient_table(values: Mapping[str, float], stds: Mapping[str, float], units: Mapping[str, str]) -> Table:
    """Return a table with one row per coefficient."""
    rows = [
        [name, Cell(uncertain(values[name], stds[name], unit), value=values[name], std=stds[name], unit=unit)]
        for name, unit in units.items()
    ]
    return Table(["Parameter", "Value (standard error)"], rows)


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates(Reported):
    """Coefficients of a regression, with uncertainties from its scatter.

    Attributes:
        values, std_errors, units: by name, SI.
        covariance: covariance matrix in the order of the names, shape (p, p), from the noise and times the reduced
            chi^2 if this is above one.
        chi2_reduced: scatter of the data about the regression, relative to the noise. Uncertain times of the reversals
            and forces outside of the regression make it larger than one.
        notes: sentences about skipped records.

    Examples:
        >>> import numpy as np
        >>> estimates = Estimates.of({"mu": ""}, [0.05], np.array([[1e-8]]), chi2_reduced=4.0)
        >>> print(estimates.summary())
        Parameter  Value (standard error)
        ─────────  ──────────────────────
        mu                    0.05000(20)
        <BLANKLINE>
        reduced chi^2: 4
    """

    values: dict[str, float]
    std_errors: dict[str, float]
    units: dict[str, str]
    covariance: np.ndarray
    chi2_reduced: float
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        units: dict[str, str],
        values: Sequence[float] | np.ndarray,
        covariance: np.ndarray,
        chi2_reduced: float,
        notes: tuple[str, ...] = (),
    ) -> "Estimates":
        """Create estimates; `covariance` is that of the noise alone.

        The values are in the order of `units`.
        """
        covariance = covariance * max(chi2_reduced, 1.0)
        std = np.sqrt(np.diag(covariance))
        by_name, errors = (dict(zip(units, map(float, each), strict=True)) for each in (values, std))
        return cls(by_name, errors, units, covariance, chi2_reduced, notes)

    def report(self) -> Report:
        """Report the coefficients, their scatter, and the skipped records."""
        table = coefficient_table(self.values, self.std_errors, self.units)
        return Report([table], [("reduced chi^2", f"{self.chi2_reduced:.3g}")], self.notes, data=vars(self))


@dataclasses.dataclass(frozen=True, eq=False)
class RouteFit(Reported):
    """Coefficients from pairs of displacements.

    Attributes:
        route: name of the route.
        names: fitted parameters, in the order of the covariance.
        values, std_errors, units: by name, SI. A bracketed static coefficient is in `values`, as the middle of its
            interval, and has no standard error. If the stated noise is too small for the residuals, the standard errors
            are enlarged to match them.
        combined_std_errors: standard errors with the uncertainties of the rig, if the route uses a rig.
        intervals: 95 % intervals of the combined errors, by Student's t if the noise follows from few residuals; for a
            bracketed static coefficient the interval between stops and non-stops.
        covariance: shape (p, p); inf where a parameter is undetermined.
        flags: remarks on each parameter.
        converged, status: True if the numbers are valid, and the outcome in words.
        warnings: sentences about limitations of the numbers.
        x0, xf, predicted: initial, final and computed final displacement of each pair [m], shape (pairs,).
        half_cycles: number of half-cycles of each pair, shape (pairs,).
        sigma: standard deviation of each final displacement [m], shape (pairs,); `sigma_source` names its source.
        chi2, dof: sum of squared weighted residuals and degrees of freedom.
        extras: further estimates by name; an unknown standard uncertainty is NaN.

    Examples:
        >>> import fricjax as fj
        >>> rig = fj.Rig(mass=0.4, stiffness=2500.0, damping=0.0, normal_force=10.0)
        >>> fit = fj.fit_triangle_map([1.1e-3, 1.5e-3, 2.0e-3], [1e-4, -1e-4, 0.0], rig, half_cycles=[3, 4, 5])
        >>> fit.names, round(fit.values["mu"], 4), fit.status
        (('mu',), 0.05, 'converged')
    """

    route: str
    names: tuple[str, ...]
    values: dict[str, float]
    std_errors: dict[str, float]
    combined_std_errors: dict[str, float]
    units: dict[str, str]
    intervals: dict[str, tuple[float, float]]
    covariance: np.ndarray
    flags: dict[str, tuple[str, ...]]
    converged: bool
    status: str
    warnings: tuple[str, ...]
    x0: np.ndarray
    xf: np.ndarray
    predicted: np.ndarray
    half_cycles: np.ndarray
    sigma: np.ndarray
    sigma_source: str
    chi2: float
    dof: int
    extras: dict[str, Measured]

    @property
    def residuals(self) -> np.ndarray:
        """Measured minus computed final displacement [m], shape (pairs,)."""
        return self.xf - self.predicted

    @property
    def chi2_reduced(self) -> float:
        """Sum of squared weighted residuals per degree of freedom."""
        return self.chi2 / self.dof

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix, shape (p, p); NaN where undetermined."""
        return correlation(self.covariance)

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"RouteFit({self.route}: {shown}; {self.status})"

    def report(self) -> Report:
        """Report one row per estimate, with route, status, data and residuals."""
        rows = []
        for name, value in self.values.items():
            # A bracketed coefficient has an interval instead of a standard error.
            std, unit = self.combined_std_errors.get(name), self.units[name]
            shown = "" if std is None else uncertain(value, std, unit)
            errors = {"std": self.std_errors.get(name, np.nan), "combined_std": np.nan if std is None else std}
            low, high = self.intervals[name]
            ends = Cell(interval(low, high, unit), low=low, high=high, unit=unit)
            rows.append([name, Cell(shown, value=value, **errors), ends, "; ".join(self.flags[name])])
        for name, number in self.extras.items():
            bare = f"{plain(number.value, 4)} {number.unit}".strip()
            numbers = {"value": number.value, "combined_std": number.std, "unit": number.unit or ""}
            shown = Cell(bare if np.isnan(number.std) else number, **numbers)
            rows.append([name.replace("_", " "), shown, Cell(""), ""])
        rms = engineering(float(np.sqrt(np.mean(self.residuals**2))), "m")
        facts = [
            ("route", self.route),
            ("status", self.status),
            ("pairs", f"{self.x0.size}, with {self.half_cycles.min()} to {self.half_cycles.max()} half-cycles"),
            ("noise", f"{engineering(float(np.median(self.sigma)), 'm')} ({self.sigma_source})"),
            ("residuals", f"{rms} rms, reduced chi^2 {plain(self.chi2_reduced, 4)}"),
        ]
        table = Table(["Parameter", "Value (standard error)", "95 % interval", "Remarks"], rows)
        data = vars(self) | {"chi2_reduced": self.chi2_reduced, "schema": "fricjax.route/2"}
        return Report([table], facts, warnings=self.warnings, heading="Route", data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot final against initial displacements, and the residuals.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure(2, 1, share_x=True, heights=(5, 2))
        top, bottom = axes[:, 0]
        across, x_unit = display_unit(float(np.max(np.abs(self.x0))), "m")
        along, y_unit = display_unit(float(np.max(np.abs(self.xf))), "m")
        fine, r_unit = display_unit(float(np.max(np.abs(self.residuals))), "m")
        order = np.argsort(self.x0)
        top.plot(across * self.x0[order], along * self.predicted[order], "x", markersize=6, label="computed")
        top.plot(across * self.x0, along * self.xf, "o", markersize=3, label="measured")
        top.set_ylabel(axis_label("Final displacement", y_unit))
        top.legend(loc="best", fontsize=8)
        bottom.axhline(0.0, color="0.7", linewidth=0.8)
        bottom.errorbar(across * self.x0, fine * self.residuals, fine * self.sigma, fmt="o", markersize=3)
        bottom.set_ylabel(axis_label("Residual", r_unit))
        bottom.set_xlabel(axis_label("Initial displacement", x_unit))
        drawing.align_ylabels()
        return styled(drawing, style)
