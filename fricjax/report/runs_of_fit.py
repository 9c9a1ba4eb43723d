"""Runs of a fit as a table like that of an archive.

Therefore the same page shows both. The curves are denser than those of an archive.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ..archive.study import name_of
from ..data import Record
from ..data.observation import Observation
from ..errors import DataError
from ..fitting import Fit
from ..show.thumbnail import sketched

if TYPE_CHECKING:
    from pandas import DataFrame

# About the number of pixel columns of a screen; each column shows its highest and lowest sample.
_POINTS = 2000


def runs_of(fit: Fit) -> "DataFrame":
    """Build a table with one row per run of a fit.

    Its columns are those of an archive that a fit can provide.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fitted = runs_of(fj.fit(run, machine, ["mu", "damping", "stiffness"]))
        >>> fitted["friction"][0], len(fitted["sketch_x"][0])
        ('coulomb', 1200)
    """
    import pandas as pd

    return pd.DataFrame([_row(fit, run) for run in range(len(fit.runs))])


def _row(fit: Fit, run: int) -> dict[str, Any]:
    row: dict[str, Any] = {
        "key": str(run),
        "file": fit.labels[run],
        "friction": name_of(fit.oscillator),
        "status": "ok" if fit.described else "invalid",
        "outcome": fit.status,
        "warnings": " ".join(fit.warnings),
    }
    number = f"[{run}]"
    for name in fit.std_errors:
        # Each row contains the parameters of its run.
        if name.endswith(number) or not name.endswith("]"):
            numbers = fit.values[name], fit.std_errors[name], fit.combined_std_errors[name]
            row |= dict(zip(_columns(name.removesuffix(number)), numbers, strict=True))
    for name, estimate in fit.kinematics.items():
        row |= dict(zip(_columns(name), (estimate.value, estimate.std, estimate.std), strict=True))
    t, x = np.asarray(fit.times[run]), np.asarray(fit.runs[run].x)
    residual = fit.residuals_by_run[run]
    equilibrium = fit.run_parameter("offset", run) + fit.run_parameter("drift", run) * (t - fit.origins[run])
    row |= {
        "residual_rms": float(np.sqrt(np.nanmean(residual**2))) if np.isfinite(residual).any() else np.nan,
        "sigma": fit.sigma,
        "half_cycles": -1 if fit.half_cycles[run] is None else fit.half_cycles[run],
        "engine": fit.engine,
        "quantity": fit.quantity,
        "samples": t.size,
        "rate": 1 / float(np.median(np.diff(t))),
        "duration": float(np.ptp(t)),
        "load": float(fit.oscillator.normal_force),
    }
    return row | _curves(t, x - equilibrium, residual, fit.observation)


def _columns(name: str) -> tuple[str, str, str]:
    return name, f"{name}_std", f"{name}_combined_std"


def _curves(t: np.ndarray, x: np.ndarray, residual: np.ndarray, observation: Observation) -> dict[str, np.ndarray]:
    """Select samples to draw, the reversals, and the stop of a displacement."""
    kept = sketched(residual, _POINTS)
    curves = {"sketch_t": t[kept], "sketch_x": x[kept], "sketch_residual": residual[kept]}
    none = {**curves, "reversal_t": np.empty(0), "reversal_x": np.empty(0)}
    if observation.kind != "displacement":
        return none
    try:
        decay = Record(t, x).segmentation
    except DataError:
        return none
    stop = [] if decay.rest is None or decay.rest_position is None else [(decay.rest, decay.rest_position)]
    reversals = np.array([*zip(decay.turning_times, decay.turning_points, strict=True), *stop]).reshape(-1, 2)
    return {**curves, "reversal_t": reversals[:, 0], "reversal_x": reversals[:, 1]}
