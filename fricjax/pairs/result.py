"""What the routes return: numbers with their uncertainty and what they rest on, all shown in one way."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..estimation.covariance import correlation
from ..rig import Measured
from ..show import (
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
    """One row per coefficient."""
    rows = [[name, uncertain(values[name], stds[name], unit)] for name, unit in units.items()]
    return Table(["Parameter", "Value (standard error)"], rows)


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates(Reported):
    """Coefficients with their uncertainty from the scatter of the data about a regression.

    Attributes:
        values, std_errors, units: by name, SI.
        covariance: in the order of the names, shape (p, p): that of the noise, times the reduced chi^2 above one.
        chi2_reduced: scatter of the data about the regression, over what the noise explains. Uncertain instants of the
            reversals and forces that the regression does not describe make it larger than one.
        notes: sentences on records that were left out.

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
        """Estimates of the names in `units`, in their order; the covariance passed is that of the noise alone."""
        covariance = covariance * max(chi2_reduced, 1.0)
        std = np.sqrt(np.diag(covariance))
        by_name, errors = (dict(zip(units, map(float, each), strict=True)) for each in (values, std))
        return cls(by_name, errors, units, covariance, chi2_reduced, notes)

    def report(self) -> Report:
        """The coefficients, their scatter, and the records that were left out."""
        table = coefficient_table(self.values, self.std_errors, self.units)
        return Report([table], [("reduced chi^2", f"{self.chi2_reduced:.3g}")], self.notes, data=vars(self))


@dataclasses.dataclass(frozen=True, eq=False)
class RouteFit(Reported):
    """Coefficients from pairs of displacements.

    Attributes:
        route: name of the route.
        names: fitted parameters, in the order of the covariance.
        values, std_errors, units: by name, SI; a bracketed static coefficient is in `values` with the middle of its
            interval and has no standard error. Where the stated noise is too small for the residuals, the standard
            errors are enlarged to them.
        combined_std_errors: with the uncertainties of the rig, where the route takes one.
        intervals: 95 % intervals of the combined errors, by Student's t where the noise is that of few residuals; for a
            bracketed static coefficient the interval between stops and non-stops.
        covariance: shape (p, p); inf where a parameter is undetermined.
        flags: what is special about each parameter.
        converged, status: whether the numbers are valid, and the outcome in words.
        warnings: what a reader of the numbers must know, in sentences.
        x0, xf, predicted: initial, final and computed final displacement of each pair [m], shape (pairs,).
        half_cycles: number of half-cycles of each pair, shape (pairs,).
        sigma: standard deviation of each final displacement [m], shape (pairs,); `sigma_source` says where it is from.
        chi2, dof: sum of squared weighted residuals and degrees of freedom.
        extras: further estimates by name; a standard uncertainty that nothing tells is NaN.

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
        """One row per parameter, bracketed coefficient and further estimate; route, outcome, data and residuals."""
        rows = []
        for name, value in self.values.items():
            # A bracketed coefficient has no standard error: its interval says all.
            std, unit = self.combined_std_errors.get(name), self.units[name]
            shown = "" if std is None else uncertain(value, std, unit)
            rows.append([name, shown, interval(*self.intervals[name], unit), "; ".join(self.flags[name])])
        for name, number in self.extras.items():
            bare = f"{plain(number.value, 4)} {number.unit}".strip()
            rows.append([name.replace("_", " "), bare if np.isnan(number.std) else str(number), "", ""])
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
        """Final against initial displacement with the computed points, and the residuals, as a matplotlib figure.

        Args:
            style: as of :func:`fricjax.show.styled`.
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
