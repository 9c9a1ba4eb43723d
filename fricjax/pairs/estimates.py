"""Coefficients found by a linear regression, with their covariance."""

import dataclasses
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from ..show import Table, uncertain


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates:
    """Coefficients with their uncertainty from the scatter of the data about the regression.

    Attributes:
        values, std_errors, units: by name, SI.
        covariance: in the order of the names, shape (p, p): that of the noise, times the reduced chi^2 above one.
        chi2_reduced: scatter of the data about the regression, over what the noise explains. Uncertain instants of the
            reversals and forces that the regression does not describe make it larger than one.
        notes: sentences on records that were left out.
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
        """Estimates of the names in `units`, in their order; the covariance given is that of the noise alone."""
        covariance = covariance * max(chi2_reduced, 1.0)
        std = np.sqrt(np.diag(covariance))
        by_name, errors = (dict(zip(units, map(float, each), strict=True)) for each in (values, std))
        return cls(by_name, errors, units, covariance, chi2_reduced, notes)

    def table(self) -> Table:
        """One row per coefficient."""
        rows = [[name, uncertain(self.values[name], self.std_errors[name], unit)] for name, unit in self.units.items()]
        return Table(["Coefficient", "Value"], rows)

    def summary(self) -> str:
        """The result as plain text."""
        return "\n".join([self.table().text(), f"\nreduced chi^2 {self.chi2_reduced:.3g}", *self.notes])

    def _repr_html_(self) -> str:
        lines = "".join(f"<p>{escape(line)}</p>" for line in (f"reduced chi^2 {self.chi2_reduced:.3g}", *self.notes))
        return self.table().html() + lines

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, in SI units."""
        return {**dataclasses.asdict(self), "covariance": self.covariance.tolist(), "notes": list(self.notes)}
