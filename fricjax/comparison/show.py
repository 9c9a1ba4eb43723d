"""How a comparison looks: the table of laws, the sentences below it, and the plot of their residuals."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import Table, axis_label, display_unit, figure, plain

if TYPE_CHECKING:
    from .result import Comparison, Row

# Differences of twice the logarithm of the evidence: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995).
_WEAK = 2.0
_ADEQUATE = 1.5


def table(comparison: "Comparison") -> Table:
    """One row per law, best first; the criteria are told by their distance from the smallest."""
    rows = [comparison.row(name) for name in comparison.ranking]
    least = {name: min(getattr(row, name) for row in rows) for name in ("aicc", "bic")}
    columns = ["Law", "Parameters", "Reduced chi^2", "AICc", "BIC", "Held out", "Residual tests", "Status"]
    cells = [
        [
            row.name,
            str(row.n_parameters) if row.tests is not None else "",
            _number(row.chi2_reduced),
            _number(row.aicc - least["aicc"]),
            _number(row.bic - least["bic"]),
            _number(row.held_out),
            _tests(row),
            row.status.split(":")[0],
        ]
        for row in rows
    ]
    return Table(columns, cells)


def _number(value: float) -> str:
    return plain(value, 4) if np.isfinite(value) else ""


def _tests(row: "Row") -> str:
    if row.tests is None:
        return ""
    failed = row.tests.failed
    return "passed" if not failed else f"failed: {', '.join(failed)}"


def remarks(comparison: "Comparison") -> list[str]:
    """What the table says, in sentences, and the fingerprints."""
    rows = [comparison.row(name) for name in comparison.ranking]
    return [_verdict(comparison, rows), *_doubts(comparison, rows), *comparison.fingerprints]


def _verdict(comparison: "Comparison", rows: "list[Row]") -> str:
    first, name = rows[0], comparison.criterion
    if len(rows) < 2 or not rows[1].ended:
        return f"{first.name} is the only law with a fit."
    label = {"bic": "BIC", "aicc": "AICc", "held_out": "the held-out score"}[name]
    apart = getattr(rows[1], name) - getattr(first, name)
    if name != "held_out" and apart < _WEAK:
        return f"{first.name} and {rows[1].name} describe the runs equally well: {label} differs by {apart:.2g} only."
    return f"{first.name} describes the runs best: {label} of {rows[1].name} is larger by {plain(apart, 3)}."


def _doubts(comparison: "Comparison", rows: "list[Row]") -> list[str]:
    found = []
    if rows[0].chi2_reduced > _ADEQUATE:
        found.append(
            f"No law describes the runs to within the noise: the reduced chi^2 of {rows[0].name} is "
            f"{plain(rows[0].chi2_reduced, 3)}."
        )
    if comparison.n_effective < comparison.n_samples:
        found.append(
            f"The residuals are not white: {comparison.n_samples} samples count as {comparison.n_effective:.0f}, and a "
            f"variance of {plain(comparison.inflation, 3)} times the stated one as noise."
        )
    found += [f"{row.name} has not converged, {row.status}" for row in rows if not row.valid]
    return found


def _head(comparison: "Comparison") -> str:
    """What the columns are, and of which files they tell."""
    told = "Distances of AICc and BIC from the smallest; held out: mean square of predicted residuals over the noise."
    return f"Fitted to {', '.join(comparison.best.labels)}. {told}" if any(comparison.sources) else told


def summary(comparison: "Comparison") -> str:
    """The comparison as plain text."""
    return "\n\n".join([table(comparison).text(), _head(comparison), "\n".join(remarks(comparison))])


def html(comparison: "Comparison") -> str:
    """The comparison as an HTML fragment."""
    return table(comparison).html() + Table(["Remarks"], [[text] for text in remarks(comparison)]).html()


def to_dict(comparison: "Comparison") -> dict[str, Any]:
    """The comparison as plain data."""
    names = ("sources", "criterion", "ranking", "n_samples", "n_effective", "inflation", "fingerprints")
    return {
        **{name: getattr(comparison, name) for name in names},
        "best": comparison.ranking[0],
        "rows": [_row(comparison, row) for row in comparison.rows],
    }


def _row(comparison: "Comparison", row: "Row") -> dict[str, Any]:
    names = (
        "name",
        "law",
        "free",
        "status",
        "valid",
        "chi2",
        "n_parameters",
        "chi2_reduced",
        "aicc",
        "bic",
        "held_out",
    )
    told: dict[str, Any] = {name: getattr(row, name) for name in names}
    fit = comparison.fits.get(row.name)
    if fit is not None:
        told |= {"values": fit.values, "std_errors": fit.std_errors, "units": fit.units, "engine": fit.engine}
    if row.tests is not None:
        told["tests"] = {**{k: v._asdict() for k, v in row.tests._asdict().items()}, "failed": row.tests.failed}
    return told


def plot(comparison: "Comparison", run: int = 0) -> Any:
    """Residuals of each law over time, best on top, and below them how far each lies behind the best."""
    names = [name for name in comparison.ranking if name in comparison.fits]
    drawing, axes = figure(len(names), 1, share_x=True)
    for each, name in zip(axes[:, 0], names, strict=True):
        fit, row = comparison.fits[name], comparison.row(name)
        fit._check_run(run)
        residuals = fit.residuals[run] if isinstance(fit.residuals, tuple) else fit.residuals
        factor, unit = display_unit(float(np.nanmax(np.abs(residuals))), fit.quantity)
        each.axhspan(-2 * factor * fit.sigma, 2 * factor * fit.sigma, color="0.9", zorder=0)
        each.plot(fit.times[run], factor * residuals, linewidth=0.5)
        each.set_ylabel(axis_label("Residual", unit))
        behind = row.bic - min(r.bic for r in comparison.rows)
        title = f"{name}: reduced chi^2 {_number(row.chi2_reduced)}, BIC + {_number(behind)}"
        each.set_title(title, fontsize=9, loc="left")
    axes[-1, 0].set_xlabel(axis_label("Time", "s"))
    drawing.align_ylabels()
    return drawing
