"""Report and plots of a fit.

The functions take a :class:`~fricjax.fitting.Fit`, which they cannot import: that module imports this one.
"""

import contextlib
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..data.record import labels, listed
from ..errors import DataError
from ..friction.base import law_name
from ..show import Report, Table, axis_label, display_unit, engineering, figure, interval, plain, scaled, uncertain
from ..show.thumbnail import Curve, curves_svg
from .names import of_run
from .rest import CONTRADICTED

# Largest number of runs listed in the report of a batch.
_LISTED_RUNS = 20
_THUMBNAILS = 2  # coefficients of a batch drawn next to its table
# Ratio above which errors of white noise are shown too, and noise is reported as larger than stated.
_NOTABLE = 1.3


def parameter_table(fit: Any) -> Table:
    """Return one row per parameter: value, statistical standard error, flags."""
    rows = []
    for name in fit.values:
        unit, value, flags = fit.units[name], fit.values[name], "; ".join(fit.flags[name])
        if name in fit.std_errors:
            std, combined, white = fit.std_errors[name], fit.combined_std_errors[name], fit.white_std_errors[name]
            rows.append([name, _value(fit, value, combined, unit), _small(std), _small(white), flags])
        else:
            low, high = fit.intervals[name]
            rows.append([name, interval(low, high, unit), "", "", flags])
    columns = ["Parameter", "Value (combined uncertainty)", "Statistical", "Statistical (white noise)", "Remarks"]
    if not _unlike_white(fit):
        columns, rows = [*columns[:3], columns[4]], [[*row[:3], row[4]] for row in rows]
    return Table(columns, rows)


def _unlike_white(fit: Any) -> bool:
    """Return True if white noise would give notably different standard errors."""
    pairs = [(fit.std_errors[name], fit.white_std_errors[name]) for name in fit.std_errors]
    return any(np.isfinite(std) and std > 0 and not 1 / _NOTABLE <= white / std <= _NOTABLE for std, white in pairs)


def _small(std: float) -> str:
    return f"{std:.2g}" if np.isfinite(std) else ""


def kinematics_table(fit: Any) -> Table:
    """Return the quantities that need no rig."""
    rows = []
    for name, estimate in fit.kinematics.items():
        unit = estimate.unit.replace("m", fit.observation.motion)
        rows.append([name.replace("_", " "), _value(fit, estimate.value, estimate.std, unit)])
    return Table(["Kinematics", "Value"], rows)


def _value(fit: Any, value: float, std: float, unit: str) -> str:
    """Format a value with its uncertainty, or "at bound" without one."""
    raised = {flag for flags in fit.flags.values() for flag in flags}
    text = uncertain(value, std, unit)
    bounded = "at bound" in raised and "undetermined" not in raised
    return text.replace("(undetermined)", "(at bound)") if bounded else text


def facts(fit: Any) -> list[tuple[str, str]]:
    """Return the other lines of the report, without values that are infinite."""
    restoring = type(fit.oscillator.restoring).__name__.lower()
    used = sum(int(np.isfinite(r).sum()) for r in fit.residuals_by_run)
    stages = "1 stage" if fit.stages == 1 else f"{fit.stages} stages"
    return [
        *([("record", listed(fit.sources))] if any(fit.sources) else []),
        ("status", fit.status),
        ("model", f"{law_name(fit.oscillator.friction)} friction, {restoring} restoring force, {fit.engine} engine"),
        ("samples", f"{used} fitted, {stages}, {fit.iterations} iterations, {fit.passes} passes"),
        ("noise", "; ".join(_noise(fit))),
        *_budget(fit),
        *_accuracy(fit),
        *_stop(fit),
    ]


def _noise(fit: Any) -> Iterator[str]:
    """Yield level and source of the noise, and deviations from white noise."""
    model = "" if fit.noise == "auto" else f", noise model {fit.noise}"
    yield f"{engineering(fit.sigma, fit.quantity)} ({fit.sigma_source}), mode {fit.sigma_mode}{model}"
    for label, noise in zip(fit.labels, fit.noises, strict=True):
        where = "it" if len(fit.noises) == 1 else f"that of {label}"
        if fit.sigma_mode == "absolute" and noise.excess > _NOTABLE:
            yield f"{where} is {noise.excess:.2g} times as large"
        yield from (f"{where} {word}" for word in noise.words(fit.quantity))


def _budget(fit: Any) -> Iterator[tuple[str, str]]:
    """Yield the largest source of variance of each shared coefficient.

    Nothing is yielded without a rig. The two contributions of a periodic nonlinearity are combined, because its phase
    is unknown.
    """
    parts_of_names = []
    for name in fit.names:
        std = fit.std_errors[name]
        if of_run(name) or not fit.contributions[name]:
            continue
        parts = {"noise": std}
        for source, change in fit.contributions[name].items():
            source = source.removesuffix("_cosine").removesuffix("_sine")
            parts[source] = float(np.hypot(parts.get(source, 0.0), change))
        total = float(np.linalg.norm(list(parts.values())))
        if 0 < total < np.inf:
            largest = max(parts, key=parts.__getitem__)
            share = f"{100 * (parts[largest] / total) ** 2:.0f} %"
            parts_of_names.append(f"{name}: {largest} {share}" + ("" if parts_of_names else " of the variance"))
    if parts_of_names:
        yield "rig inputs", "; ".join(parts_of_names)


def _accuracy(fit: Any) -> Iterator[tuple[str, str]]:
    """Yield the size of the residuals and of the numerical error."""
    if np.isfinite(fit.chi2):
        rms, reduced = engineering(fit.residual_rms, fit.quantity), plain(fit.chi2_reduced, 4)
        without_slow = max(noise.excess for noise in fit.noises) * fit.sigma
        more = any(noise.drift or noise.lines for noise in fit.noises)
        apart = f", {engineering(without_slow, fit.quantity)} without drift and hum" if more else ""
        yield "residuals", f"{rms} rms{apart}, reduced chi^2 {reduced}"
    if np.isfinite(fit.numerical_shift):
        yield "numerics", f"numerical error at most {fit.numerical_shift:.2g} standard errors"


def _stop(fit: Any) -> Iterator[tuple[str, str]]:
    """Yield the number of half-cycles and the bracket of static friction."""
    for label, count, margin in zip(fit.labels, fit.half_cycles, fit.margins, strict=True):
        where = "" if len(fit.labels) == 1 else f" of {label}"
        if count is not None and margin is not None and not np.any(np.isnan(margin)):
            more, less = (engineering(value, fit.observation.motion) for value in margin)
            yield "half-cycles", f"{count} to the stop{where}; margin to one more {more}, to one less {less}"
    bracket = fit.intervals.get("mu_s")
    if bracket is not None and "mu_s" not in fit.values and not np.any(np.isnan(bracket)):
        where = f"{CONTRADICTED}, over" if CONTRADICTED in fit.flags.get("mu_s", ()) else "between"
        yield "mu_s", f"{where} {interval(*bracket)}, from the last stop and non-stop"


def report_of(fit: Any) -> Report:
    """Return the report of a fit."""
    return Report([parameter_table(fit), kinematics_table(fit)], facts(fit), warnings=fit.warnings, heading="Fit")


def batch_report(batch: Any) -> Report:
    """Return the report of a batch: first runs, populations, and outcomes."""
    names = [name for name in batch.values if not of_run(name)]
    combined, runs = batch.combined_std_errors, labels(batch.sources)
    rows = [
        [runs[i], *(uncertain(batch.values[name][i], combined[name][i]) for name in names), _outcome(batch.status[i])]
        for i in range(min(len(batch), _LISTED_RUNS))
    ]
    heads = [axis_label(name, batch.units[name]) for name in names]
    endings = Counter(map(_outcome, batch.status)).most_common()
    facts = [
        ("runs", f"{len(batch)}: " + ", ".join(f"{count} {outcome}" for outcome, count in endings)),
        ("engine", batch.engine),
    ]
    more = len(batch) - len(rows)
    notes = [f"{more} more runs are in to_dataframe()."] if more > 0 else []
    wrong = sum(map(bool, batch.warnings))
    warnings = [f"{wrong} of {len(batch)} runs have warnings, which are in to_dataframe()."] if wrong else []
    tables = [Table(["Run", *heads, "Outcome"], rows), _populations(batch, names)]
    return Report(tables, facts, notes, warnings, heading="Batch", data=vars(batch))


def _outcome(status: str) -> str:
    return status.partition(":")[0]


def _populations(batch: Any, names: list[str]) -> Table:
    """Return mean and scatter of the coefficients over the runs.

    Coefficients with fewer than three values are omitted.
    """
    rows = []
    for name in names:
        # Fewer than three runs do not determine a scatter.
        with contextlib.suppress(DataError):
            pooled = batch.population(name)
            mean, scatter = uncertain(pooled.mean, pooled.combined_std), plain(pooled.scatter, 3)
            rows.append([axis_label(name, batch.units[name]), mean, scatter, pooled.runs, len(pooled.outliers)])
    return Table(["Over the runs", "Mean", "Scatter from run to run", "Runs", "Set aside"], rows)


def thumbnails(fit: Any) -> list[str]:
    """Draw the first run with the model, and its residuals."""
    t, x, r = fit.times[0], np.asarray(fit.runs[0].x), fit.residuals_by_run[0]
    both = [Curve(t, x, broad=True), Curve(t, x - r)]
    traces = [(both, fit.observation.name), ([Curve(t, r)], "Residual")]
    return [curves_svg(curves, ("Time", "s"), (label, fit.quantity)) for curves, label in traces]


def batch_thumbnails(batch: Any) -> list[str]:
    """Draw the first coefficients against the number of the run."""
    names = [name for name in batch.values if not of_run(name)][:_THUMBNAILS]
    runs = np.arange(len(batch))
    curves = [(name, Curve(runs, batch.values[name], batch.std_errors[name])) for name in names]
    return [curves_svg([curve], ("Run", ""), (name, batch.units[name])) for name, curve in curves]


def batch_plot(batch: Any) -> Any:
    """Plot each coefficient against the run number, with mean and scatter."""
    names = [name for name in batch.values if not of_run(name)]
    drawing, axes = figure(len(names), share_x=True)
    runs, good = np.arange(len(batch)), batch.described
    for each, name in zip(axes[:, 0], names, strict=True):
        values, unit = scaled(batch.values[name], batch.units[name])
        factor, _ = display_unit(float(np.nanmax(np.abs(batch.values[name]), initial=0.0)), batch.units[name])
        bars = np.where(np.isfinite(batch.std_errors[name]), factor * batch.std_errors[name], 0.0)
        for which, face in ((good, "#0072B2"), (~good, "white")):
            points = {"linestyle": "none", "marker": "o", "markersize": 3.5, "color": "#0072B2", "mfc": face}
            each.errorbar(runs[which], values[which], bars[which], **points)
        with contextlib.suppress(DataError):  # fewer than three runs do not determine a scatter
            pooled = batch.population(name)
            mean, scatter = factor * pooled.mean, factor * pooled.scatter
            each.axhline(mean, color="#D55E00", linewidth=1.0)
            each.axhspan(mean - scatter, mean + scatter, color="#D55E00", alpha=0.15, zorder=0)
        each.set_ylabel(axis_label(name, unit))
        each.ticklabel_format(axis="y", useOffset=False)
    axes[-1, 0].set_xlabel("Run")
    axes[-1, 0].xaxis.get_major_locator().set_params(integer=True)
    drawing.align_ylabels()
    return drawing


def plot(fit: Any, run: int = 0) -> Any:
    """Plot measured and computed trace, and residuals with the noise band.

    Args:
        fit: the fit.
        run: number of the run in a joint fit.
    """
    drawing, axes = figure(2, 1, share_x=True, heights=(5, 2))
    top, bottom = axes[:, 0]
    _draw_trace(top, fit, run)
    _draw_residuals(bottom, fit, run)
    bottom.set_xlabel(axis_label("Time", "s"))
    drawing.align_ylabels()
    return drawing


def _draw_trace(axes: Any, fit: Any, run: int) -> None:
    """Draw the record as a broad line, and the model.

    Samples that are not fitted are grey.
    """
    t, x, r = fit.times[run], np.asarray(fit.runs[run].x), fit.residuals_by_run[run]
    fitted = np.isfinite(r)
    factor, unit = display_unit(float(np.max(np.abs(x))), fit.quantity)
    if not fitted.all():
        axes.plot(t, factor * x, color="0.8", linewidth=3.0, label="not fitted")
    axes.plot(t, np.where(fitted, factor * x, np.nan), color="#56B4E9", linewidth=3.5, label="measured")
    model = np.where(fitted, factor * (x - np.where(fitted, r, 0.0)), np.nan)
    axes.plot(t, model, color="#8C2D04", linewidth=1.0, label="model")
    axes.set_ylabel(axis_label(fit.observation.name, unit))
    axes.legend(loc="upper right", fontsize=8, framealpha=0.9)
    title = f"{law_name(fit.oscillator.friction)} friction, {fit.engine} engine: {fit.status.split(':')[0]}"
    axes.set_title(", ".join(filter(None, [fit.sources[run], title])), fontsize=9, loc="left")


def _draw_residuals(axes: Any, fit: Any, run: int) -> None:
    """Draw measured minus model, with drift and hum of the noise.

    If the model describes the run, 95 % of the samples lie within two standard deviations of these.
    """
    t, residuals = fit.times[run], fit.residuals_by_run[run]
    slow = fit.noises[run].at(t - fit.origins[run])
    factor, unit = display_unit(float(np.nanmax(np.abs(residuals))), fit.quantity)
    axes.fill_between(t, *(factor * (slow + side * fit.sigma) for side in (-2, 2)), color="0.9", linewidth=0, zorder=0)
    axes.plot(t, factor * residuals, color="#0072B2", linewidth=0.5)
    axes.set_ylabel(axis_label("Residual", unit))
    rms = engineering(float(np.sqrt(np.nanmean(residuals**2))), fit.quantity)
    title = f"measured minus model: {rms} rms; band: twice the noise of {engineering(fit.sigma, fit.quantity)}"
    if np.any(slow):
        axes.plot(t, factor * slow, color="#D55E00", linewidth=1.0)
        title += " about drift and hum"
    axes.set_title(title, fontsize=9, loc="left")
