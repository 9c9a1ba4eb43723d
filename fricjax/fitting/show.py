"""How a fit looks: the report in text and HTML, and the plot of trace and residuals."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import Table, axis_label, engineering, figure, interval, plain, scaled, uncertain

if TYPE_CHECKING:
    from .result import Fit


def parameter_table(fit: "Fit") -> Table:
    """One row per parameter: value with combined uncertainty, statistical standard error, flags."""
    rows = []
    for name in fit.values:
        unit, value = fit.units[name], fit.values[name]
        if name in fit.std_errors:
            std, combined = fit.std_errors[name], fit.combined_std_errors[name]
            rows.append([name, uncertain(value, combined, unit), _small(std), "; ".join(fit.flags[name])])
        else:
            rows.append([name, interval(*fit.intervals[name], unit), "", "; ".join(fit.flags[name])])
    return Table(["Parameter", "Value (combined uncertainty)", "Statistical", "Remarks"], rows)


def _small(std: float) -> str:
    return f"{std:.2g}" if np.isfinite(std) else "undetermined"


def kinematics_table(fit: "Fit") -> Table:
    """What the trace tells without a rig."""
    rows = []
    for name, estimate in fit.kinematics.items():
        unit = estimate.unit.replace("m", fit.quantity) if fit.quantity != "m" else estimate.unit
        rows.append([name.replace("_", " "), uncertain(estimate.value, estimate.std, unit)])
    return Table(["Kinematics", "Value"], rows)


def facts(fit: "Fit") -> list[tuple[str, str]]:
    """The remaining lines of the report."""
    law = type(fit.oscillator.friction).__name__
    used = sum(int(np.isfinite(r).sum()) for r in _runs(fit))
    lines = [
        ("status", fit.status),
        ("model", f"{law} friction, {type(fit.oscillator.restoring).__name__.lower()} restoring force, {fit.engine} engine"),
        ("samples", f"{used} fitted, {fit.iterations} stages, {fit.passes} passes"),
        ("noise", f"{engineering(fit.sigma, fit.quantity)} ({fit.sigma_source}), mode {fit.sigma_mode}"),
        ("residuals", f"{engineering(fit.residual_rms, fit.quantity)} rms, reduced chi^2 {plain(fit.chi2_reduced, 4)}"),
    ]
    for count, margin in zip(fit.half_cycles, fit.margins, strict=True):
        if count is not None and margin is not None:
            more, less = (engineering(value, fit.quantity) for value in margin)
            lines.append(("half-cycles", f"{count} to the stop; margin to one more {more}, to one less {less}"))
    if "mu_s" in fit.intervals and "mu_s" not in fit.std_errors:
        lines.append(("mu_s", f"between {interval(*fit.intervals['mu_s'])}, from the last stop and non-stop"))
    return lines


def summary(fit: "Fit") -> str:
    """The report as plain text."""
    lines = [f"{name + ':':<13}{text}" for name, text in facts(fit)]
    warned = [f"! {sentence}" for sentence in fit.warnings]
    return "\n\n".join(filter(None, [parameter_table(fit).text(), kinematics_table(fit).text(), "\n".join([*lines, *warned])]))


def html(fit: "Fit") -> str:
    """The report as an HTML fragment."""
    other = Table(["Fit", ""], [*facts(fit), *(("warning", sentence) for sentence in fit.warnings)])
    return parameter_table(fit).html() + kinematics_table(fit).html() + other.html()


def _runs(fit: "Fit") -> tuple[np.ndarray, ...]:
    return fit.residuals if isinstance(fit.residuals, tuple) else (fit.residuals,)


def plot(fit: "Fit", run: int = 0) -> Any:
    """Measured and computed trace above, residuals below."""
    t, r = fit.times[run], _runs(fit)[run]
    fitted = np.isfinite(r)
    measured = np.where(fitted, np.asarray(fit.runs[run].x), np.nan)
    drawing, axes = figure(2, 1, share_x=True, heights=(3, 1))
    top, bottom = axes[:, 0]
    everything, unit = scaled(np.asarray(fit.runs[run].x), fit.quantity)
    factor = everything[np.argmax(np.abs(everything))] / np.asarray(fit.runs[run].x)[np.argmax(np.abs(everything))]
    top.plot(t, everything, color="0.75", label="not fitted")
    top.plot(t, measured * factor, label="measured")
    top.plot(t[fitted], (measured - r)[fitted] * factor, linestyle="--", label="model")
    name = "Displacement" if fit.quantity == "m" else "Angle"
    top.set_ylabel(axis_label(name, unit))
    top.legend(loc="upper right")
    small, unit = scaled(r, fit.quantity)
    bottom.plot(t, small, linewidth=0.6)
    bottom.set_ylabel(axis_label("Residual", unit))
    bottom.set_xlabel(axis_label("Time", "s"))
    return drawing
