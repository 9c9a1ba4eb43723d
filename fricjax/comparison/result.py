"""The result of a comparison: what each law came to, and which of them comes first."""

import dataclasses
from typing import Any

import numpy as np

from ..errors import UsageError, nearest
from ..fitting.result import Fit
from .residual_tests import ResidualTests


@dataclasses.dataclass(frozen=True)
class Row:
    """What one law came to.

    Attributes:
        name, law: what the comparison calls it, and the names of its laws.
        free: coefficients of the machine that were free.
        status: the outcome of its fit in words; `valid`: converged, as of a `Fit`; `ended`: at an optimum,
            which a law that contains a better one reaches with coefficients that nothing determines.
        chi2, n_parameters: sum of squared residuals in units of the noise, and number of free parameters, those of
            the runs included.
        chi2_reduced: chi2 per degree of freedom; of the residuals weighed by the noise of the best law where that is
            not white.
        aicc, bic: criteria of the comparison; smaller is better.
        held_out: mean square of the held-out residuals in units of the noise, as stated or, where it is not white, as
            the best law leaves it; one for the right law, NaN where nothing was held out.
        tests: tests of the residuals, weighed by the noise of the best law where that is not white; None without a fit.
    """

    name: str
    law: str
    free: tuple[str, ...]
    status: str
    valid: bool = False
    ended: bool = False
    chi2: float = np.inf
    n_parameters: int = 0
    chi2_reduced: float = np.inf
    aicc: float = np.inf
    bic: float = np.inf
    held_out: float = np.nan
    tests: ResidualTests | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """Laws side by side on the same samples.

    Attributes:
        rows: what each law came to, in the order in which they were given.
        criterion: what they are ranked by: "bic", "aicc" or "held_out".
        ranking: their names, best first; laws whose fit found no optimum come last.
        fits: fits by name; without those that were refused.
        n_samples: number of fitted samples, the same for all; `n_effective`: how many independent ones they are worth.
        inflation: variance of the residuals that counts as noise, in units of the stated one (see `compare`).
        fingerprints: what the decay itself says of friction, in sentences.
    """

    rows: tuple[Row, ...]
    criterion: str
    ranking: tuple[str, ...]
    fits: dict[str, Fit]
    n_samples: int
    n_effective: float
    inflation: float
    fingerprints: tuple[str, ...]

    @property
    def sources(self) -> tuple[str, ...]:
        """Name of the file of each run, empty where it has none."""
        return self.best.sources

    @property
    def best(self) -> Fit:
        """The fit of the law that comes first."""
        return self.fits[self.ranking[0]]

    def row(self, name: str) -> Row:
        """What the law of that name came to.

        Raises:
            UsageError: no such law.
        """
        for row in self.rows:
            if row.name == name:
                return row
        raise UsageError(f"This comparison has no {name!r}.{nearest(name, self.ranking)} It has {self.ranking}.")

    def summary(self) -> str:
        """The comparison as plain text."""
        from .show import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from .show import html

        return html(self)

    def __repr__(self) -> str:
        return f"Comparison({' < '.join(self.ranking)} by {self.criterion})"

    def plot(self, run: int = 0) -> Any:
        """Residuals of all laws over time and their distance from the best, as a matplotlib figure."""
        from .show import plot

        return plot(self, run)

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain data, without the samples."""
        from .show import to_dict

        return to_dict(self)
