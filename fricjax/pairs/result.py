"""What an evaluation route that sees no trace returns: coefficients with uncertainties, and what they rest on."""

import dataclasses
from typing import Any

import numpy as np

from ..estimation.covariance import correlation

type Estimate = tuple[float, float | None, str]


@dataclasses.dataclass(frozen=True, eq=False)
class RouteFit:
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
        flags: remarks on each parameter.
        converged, status: whether the numbers are valid, and the outcome in words.
        warnings: what a reader of the numbers must know, in sentences.
        x0, xf, predicted: initial, final and computed final displacement of each pair [m], shape (pairs,).
        half_cycles: number of half-cycles of each pair, shape (pairs,).
        sigma: standard deviation of each final displacement [m], shape (pairs,); `sigma_source` says where it is from.
        chi2, dof: sum of squared weighted residuals and degrees of freedom.
        extras: further estimates by name: value, standard error (None: not known), unit.
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
    extras: dict[str, Estimate]

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

    def summary(self) -> str:
        """The report as plain text."""
        from .show import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from .show import html

        return html(self)

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"RouteFit({self.route}: {shown}; {self.status})"

    def plot(self) -> Any:
        """Final against initial displacement with the computed points, and the residuals, as a matplotlib figure."""
        from .show import plot

        return plot(self)

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data."""
        return {field.name: _plain(getattr(self, field.name)) for field in dataclasses.fields(self)} | {
            "chi2_reduced": self.chi2_reduced,
            "schema": "fricjax.route/1",
        }


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    return list(map(_plain, value)) if isinstance(value, tuple) else value
