"""How the result of a route looks: the report in text and HTML, and the plot of the pairs."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import Table, axis_label, display_unit, engineering, figure, interval, plain, uncertain

if TYPE_CHECKING:
    from .result import RouteFit


def parameter_table(fit: "RouteFit") -> Table:
    """One row per parameter, bracketed coefficient and further estimate."""
    rows = [[name, *_shown(fit, name), "; ".join(fit.flags[name])] for name in fit.values]
    rows += [[name.replace("_", " "), _estimate(*estimate), "", ""] for name, estimate in fit.extras.items()]
    return Table(["Parameter", "Value (standard error)", "95 % interval", "Remarks"], rows)


def _shown(fit: "RouteFit", name: str) -> tuple[str, str]:
    within = interval(*fit.intervals[name], fit.units[name])
    if name not in fit.combined_std_errors:
        return "", within
    return uncertain(fit.values[name], fit.combined_std_errors[name], fit.units[name]), within


def _estimate(value: float, std: float | None, unit: str) -> str:
    return f"{plain(value, 4)} {unit}".strip() if std is None else uncertain(value, std, unit)


def facts(fit: "RouteFit") -> list[tuple[str, str]]:
    """The remaining lines of the report."""
    rms = engineering(float(np.sqrt(np.mean(fit.residuals**2))), "m")
    return [
        ("route", fit.route),
        ("status", fit.status),
        ("pairs", f"{fit.x0.size}, with {fit.half_cycles.min()} to {fit.half_cycles.max()} half-cycles"),
        ("noise", f"{engineering(float(np.median(fit.sigma)), 'm')} ({fit.sigma_source})"),
        ("residuals", f"{rms} rms, reduced chi^2 {plain(fit.chi2_reduced, 4)}"),
    ]


def summary(fit: "RouteFit") -> str:
    """The report as plain text."""
    lines = [f"{name + ':':<11}{text}" for name, text in facts(fit)]
    return "\n\n".join([parameter_table(fit).text(), "\n".join([*lines, *(f"! {text}" for text in fit.warnings)])])


def html(fit: "RouteFit") -> str:
    """The report as an HTML fragment."""
    other = Table(["Route", ""], [*facts(fit), *(("warning", sentence) for sentence in fit.warnings)])
    return parameter_table(fit).html() + other.html()


def plot(fit: "RouteFit") -> Any:
    """Final against initial displacement, with the residuals below."""
    drawing, axes = figure(2, 1, share_x=True, heights=(5, 2))
    top, bottom = axes[:, 0]
    across, x_unit = display_unit(float(np.max(np.abs(fit.x0))), "m")
    along, y_unit = display_unit(float(np.max(np.abs(fit.xf))), "m")
    fine, r_unit = display_unit(float(np.max(np.abs(fit.residuals))), "m")
    order = np.argsort(fit.x0)
    top.plot(across * fit.x0[order], along * fit.predicted[order], "x", markersize=6, label="computed")
    top.plot(across * fit.x0, along * fit.xf, "o", markersize=3, label="measured")
    top.set_ylabel(axis_label("Final displacement", y_unit))
    top.legend(loc="best", fontsize=8)
    bottom.axhline(0.0, color="0.7", linewidth=0.8)
    bottom.errorbar(across * fit.x0, fine * fit.residuals, fine * fit.sigma, fmt="o", markersize=3)
    bottom.set_ylabel(axis_label("Residual", r_unit))
    bottom.set_xlabel(axis_label("Initial displacement", x_unit))
    drawing.align_ylabels()
    return drawing
