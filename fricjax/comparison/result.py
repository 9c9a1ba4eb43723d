"""Result of a comparison: rows, ranking, report and plot."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import thresholds
from ..data.record import listed
from ..errors import UsageError, nearest
from ..fitting.result import Fit
from ..show import Cell, Report, Reported, Style, Table, axis_label, display_unit, figure, plain, styled
from ..show.thumbnail import bars_svg
from .residual_tests import ResidualTests


@dataclasses.dataclass(frozen=True)
class Row:
    """Result of one law.

    Attributes:
        name: name in the comparison.
        law: name of the law, or of the sum of laws.
        free: free coefficients of the machine.
        status: outcome of the fit in words.
        valid: whether the model describes the runs, as in a `Fit`.
        ended: whether the fit ended at an optimum. A law that contains a better one ends at an optimum with
            undetermined coefficients, so it is not `valid`.
        chi2: sum of squared residuals in units of the noise.
        n_parameters: number of free parameters, including those of the runs.
        chi2_reduced: chi2 per degree of freedom; with correlated noise, that of the weighted residuals.
        aicc, bic: criteria of the comparison; smaller is better.
        held_out: mean square of the held-out residuals in units of the stated noise, or of the noise of the best law if
            it is not white. It is one for the right law, and NaN if no samples were held out.
        tests: tests of the residuals, weighted if the noise is correlated; None without a fit.
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
class Comparison(Reported):
    """Laws side by side on the same samples.

    Attributes:
        rows: result of each law, in the given order.
        criterion: criterion of the ranking: "bic", "aicc" or "held_out".
        ranking: names of the laws, best first; laws without an optimum come last.
        fits: fits by name, without rejected ones.
        n_samples: number of fitted samples, the same for all laws.
        n_effective: equivalent number of independent samples.
        inflation: variance c by which chi2 is divided, in units of the stated noise (see `compare`).
        fingerprints: sentences about the friction, from the decay alone.

    Examples:
        >>> import fricjax as fj
        >>> example = fj.data.example_paths()
        >>> machine = fj.Rig.from_toml(example.rig).oscillator(fj.friction.Coulomb(0.02))
        >>> free = [["mu", "stiffness", "damping"], ["mu", "stiffness"]]
        >>> table = fj.compare(example.run, [machine, machine], free, names=["fitted", "known"], held_out=False)
        >>> table.ranking, table.row("known").valid, f"{table.best.values['mu']:.4f}"
        (('known', 'fitted'), True, '0.0200')
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
        """File name of each run, empty for a run without a file."""
        return self.best.sources

    @property
    def best(self) -> Fit:
        """Fit of the best law."""
        return self.fits[self.ranking[0]]

    def row(self, name: str) -> Row:
        """Return the result of the law with this name.

        Raises:
            UsageError: there is no such law.
        """
        for row in self.rows:
            if row.name == name:
                return row
        raise UsageError(f"This comparison has no {name!r}.{nearest(name, self.ranking)} It has {self.ranking}.")

    def __repr__(self) -> str:
        return f"Comparison({' < '.join(self.ranking)} by {self.criterion})"

    def report(self) -> Report:
        """Report the table of laws, the conclusion and the fingerprints."""
        rows = [self.row(name) for name in self.ranking]
        least = {name: min(getattr(row, name) for row in rows) for name in ("aicc", "bic")}
        columns = ["Law", "Parameters", "Reduced chi^2", "AICc", "BIC", "Held out", "Residual tests", "Status"]
        cells = [
            [
                row.name,
                Cell(str(row.n_parameters) if row.tests is not None else "", n_parameters=row.n_parameters),
                Cell(_number(row.chi2_reduced), chi2_reduced=row.chi2_reduced),
                Cell(_number(row.aicc - least["aicc"]), aicc=row.aicc, delta_aicc=row.aicc - least["aicc"]),
                Cell(_number(row.bic - least["bic"]), bic=row.bic, delta_bic=row.bic - least["bic"]),
                Cell(_number(row.held_out), held_out=row.held_out),
                "" if row.tests is None else row.tests.outcome,
                row.status.split(":")[0],
            ]
            for row in rows
        ]
        notes = [
            "Distances of AICc and BIC from the smallest; held out: mean square of predicted residuals over noise."
        ]
        if any(self.sources):
            notes[0] = f"Fitted to {listed(self.sources)}. {notes[0]}"
        notes += [self._conclusion(rows), *self.fingerprints]
        return Report([Table(columns, cells)], notes=notes, warnings=self._doubts(rows), data=self._data())

    def _conclusion(self, rows: list[Row]) -> str:
        first, name = rows[0], self.criterion
        if len(rows) < 2 or not rows[1].ended:
            return f"{first.name} is the only law with a fit."
        label = {"bic": "BIC", "aicc": "AICc", "held_out": "the held-out score"}[name]
        difference = getattr(rows[1], name) - getattr(first, name)
        if name != "held_out" and difference < thresholds.BARE_MENTION:
            equal = f"{first.name} and {rows[1].name} describe the runs equally well"
            return f"{equal}: {label} differs by {difference:.2g} only."
        return f"{first.name} describes the runs best: {label} of {rows[1].name} is larger by {plain(difference, 3)}."

    def _doubts(self, rows: list[Row]) -> list[str]:
        doubts = []
        if rows[0].chi2_reduced > thresholds.EXCESS:
            doubts.append(
                f"No law describes the runs to within the noise: the reduced chi^2 of {rows[0].name} is "
                f"{plain(rows[0].chi2_reduced, 3)}."
            )
        if self.n_effective < self.n_samples:
            doubts.append(
                f"The residuals are not white: {self.n_samples} samples count as {self.n_effective:.0f}, and a "
                f"variance of {plain(self.inflation, 3)} times the stated one as noise."
            )
        return doubts + [f"{row.name} is not valid, {row.status}" for row in rows if not row.valid]

    def _data(self) -> dict[str, Any]:
        """All results without the samples."""
        names = ("sources", "criterion", "ranking", "n_samples", "n_effective", "inflation", "fingerprints")
        rows = []
        for row in self.rows:
            entry = {field.name: getattr(row, field.name) for field in dataclasses.fields(row)}
            for name in ("ended", "tests"):
                del entry[name]
            fit = self.fits.get(row.name)
            if fit is not None:
                entry |= {"values": fit.values, "std_errors": fit.std_errors, "units": fit.units, "engine": fit.engine}
            if row.tests is not None:
                entry["tests"] = {**row.tests._asdict(), "failed": row.tests.failed}
            rows.append(entry)
        return {**{name: getattr(self, name) for name in names}, "best": self.ranking[0], "rows": rows}

    def thumbnails(self) -> Sequence[str]:
        rows = [self.row(name) for name in self.ranking]
        behind = [row.bic - min(row.bic for row in rows) for row in rows]
        return [bars_svg(self.ranking, behind, "BIC above that of the best law")]

    def plot(self, run: int = 0, *, style: Style = "screen") -> Any:
        """Plot the residuals of all laws over time, the best on top.

        Args:
            run: index of the run of a joint fit.
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure; each title gives the difference in BIC from the best law.
        """
        names = [name for name in self.ranking if name in self.fits]
        drawing, axes = figure(len(names), 1, share_x=True)
        least = min(row.bic for row in self.rows)
        for each, name in zip(axes[:, 0], names, strict=True):
            fit, row = self.fits[name], self.row(name)
            fit._check_run(run)
            residuals = fit.residuals_by_run[run]
            factor, unit = display_unit(float(np.nanmax(np.abs(residuals))), fit.quantity)
            each.axhspan(-2 * factor * fit.sigma, 2 * factor * fit.sigma, color="0.9", zorder=0)
            each.plot(fit.times[run], factor * residuals, linewidth=0.5)
            each.set_ylabel(f"{name}\n{axis_label('Residual', unit)}")
            title = f"reduced chi^2 {_number(row.chi2_reduced)}, BIC + {_number(row.bic - least)}"
            each.set_title(title, fontsize=9, loc="left")
        axes[-1, 0].set_xlabel(axis_label("Time", "s"))
        drawing.align_ylabels()
        return styled(drawing, style)


def _number(value: float) -> str:
    return plain(value, 4) if np.isfinite(value) else ""
