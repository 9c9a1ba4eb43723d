"""The result of a fit: values, uncertainties, and diagnostics."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..data.observation import Observation
from ..data.record import labels
from ..errors import UsageError
from ..estimation.covariance import correlation
from ..oscillator import Oscillator, observe, simulate
from ..rig import Measured
from ..show import Report, Reported, Style, styled
from . import interchange
from .diagnostics import describes, optimum_found
from .interactive import Sliders
from .noise import Noise, Whiteness
from .problem import Problem
from .residual import Run, motion
from .rest import Margin
from .show import plot, report_of, thumbnails
from .window import NEVER


class FitError(RuntimeError):
    """A fit without an optimum, or with undetermined parameters.

    The incomplete result is in the attribute `fit`.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> error = FitError("out of steps", fj.fit(run, machine, ["mu", "damping", "stiffness"]))
        >>> round(error.fit.values["mu"], 6)
        0.05
    """

    def __init__(self, message: str, fit: "Fit") -> None:
        super().__init__(message)
        self.fit = fit


@dataclasses.dataclass(frozen=True, eq=False)
class Fit(Reported):
    """A fitted oscillator.

    Attributes:
        names: free parameters in the order of the covariance; in a joint fit those of a run have its number, "x0[2]".
        values, std_errors, combined_std_errors: by name, in SI units. Standard errors follow from the noise of the
            record, including its correlation, hum, drift and jitter; the combined ones add the uncertainties of the
            rig's inputs to first order.
        white_std_errors: standard errors for white noise of the stated level.
        intervals: 95 % intervals from the statistical standard errors. For the static coefficient of a Coulomb law, the
            interval between stops and non-stops; if these contradict each other it is the range over which static
            friction varies, with a flag and a warning, and the value is NaN.
        covariance, combined_covariance: shape (p, p); inf for a parameter that is undetermined or at a bound.
        units, flags: by name; flags are remarks such as "at bound".
        converged: True if the optimum is finite and of full rank. The model may still miss the record.
        status: the outcome in words, its name before the colon or comma: "described", "no dry friction", "does not
            describe", "no free decay", "at a bound", "undetermined", "out of steps", "stalled" or "not finite".
        warnings: warnings in sentences.
        kinematics: natural frequency, damping ratio, dead band and losses per unit mass, which need no rig; with a rig,
            the uncertainties include its inputs.
        inputs: the uncertain inputs of the rig by name.
        contributions: by name of a parameter or kinematic quantity: its change per standard uncertainty of each input
            of the rig. A periodic nonlinearity has two, for a cosine and a sine of the reading.
        chi2, dof, chi2_reduced: sum of squared weighted residuals, degrees of freedom, and their ratio.
        residuals: measured minus model in the unit of the record, NaN where not fitted; a tuple of arrays in a
            joint fit.
        residual_rms: root mean square of the fitted ones.
        sigma, sigma_mode, sigma_source: median noise used, how it was used, and its source.
        noise: name of the requested noise model; "auto" selects it from the record.
        noises: noise of each run as its residuals show it, and as the standard errors include it. Drift and hum are in
            `residuals` but not in the output of `predict`.
        whiteness: autocorrelation of the residuals.
        margins: for each run the distance to one half-cycle more or less; None if it ends in motion.
        half_cycles: for each run the number of half-cycles from the start of the fit to the stop; None if it ends in
            motion.
        iterations, passes, stages: steps of Levenberg-Marquardt, each with one evaluation of model and Jacobian;
            evaluations in total; and stages of growing windows.
        numerical_shift: largest change of a parameter by numerical errors, in standard errors: the remaining step when
            all samples are evaluated on another mesh.
        engine: name of the engine.
        aicc, bic: information criteria.
        oscillator: the fitted oscillator.
        quantity: unit of the reading: "m", or "rad" for a rotary rig; "rad/s" or the like for a velocity.
        sources: file name of each run; empty if unknown.
        times: times of the samples [s], one array per run.
        runs, origins: data for `predict`.
        problem: the solved problem, with records and settings; None in a fit that was read from a file.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fit.names, fit.units["damping"], fit.covariance.shape
        (('mu', 'damping', 'stiffness', ...), 'N s/m', (...))
    """

    names: tuple[str, ...]
    values: dict[str, float]
    std_errors: dict[str, float]
    white_std_errors: dict[str, float]
    combined_std_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    covariance: np.ndarray
    combined_covariance: np.ndarray
    units: dict[str, str]
    flags: dict[str, tuple[str, ...]]
    converged: bool
    status: str
    warnings: tuple[str, ...]
    kinematics: dict[str, Measured]
    inputs: dict[str, Measured]
    contributions: dict[str, dict[str, float]]
    chi2: float
    dof: int
    residuals: Any
    residual_rms: float
    sigma: float
    sigma_mode: str
    sigma_source: str
    noise: str
    noises: tuple[Noise, ...]
    whiteness: Whiteness
    margins: tuple[Margin | None, ...]
    half_cycles: tuple[int | None, ...]
    iterations: int
    stages: int
    passes: int
    numerical_shift: float
    engine: str
    aicc: float
    bic: float
    oscillator: Oscillator
    quantity: str
    sources: tuple[str, ...]
    times: tuple[np.ndarray, ...]
    runs: tuple[Run, ...]
    origins: tuple[float, ...]
    engine_used: Any
    problem: Problem | None = None

    @property
    def described(self) -> bool:
        """True if the model describes the record.

        No other model is preferred, and at most 5 % of the motion is unexplained (`fricjax.thresholds.UNDESCRIBED`).
        """
        return describes(self.status)

    @property
    def optimum_found(self) -> bool:
        """True for an optimum of full rank.

        It may still miss the record or be at a bound.
        """
        return optimum_found(self.status)

    @property
    def observation(self) -> Observation:
        """Map from the motion to the reading of the first run."""
        return self.runs[0].observation

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each run in the report: file name or number."""
        return labels(self.sources)

    @property
    def residuals_by_run(self) -> tuple[np.ndarray, ...]:
        """The residuals of each run, always as a tuple."""
        return self.residuals if isinstance(self.residuals, tuple) else (self.residuals,)

    @property
    def chi2_reduced(self) -> float:
        """Sum of squared weighted residuals per degree of freedom."""
        return self.chi2 / self.dof

    @property
    def correlation(self) -> np.ndarray:
        """Correlation matrix, shape (p, p); NaN where undetermined."""
        return correlation(self.covariance)

    def predict(self, ts: Any, run: int = 0) -> np.ndarray:
        """Predict the reading of the instrument at given times.

        The times `ts` are those of the record [s]. The result includes offset and drift; its shape is (n,). Times
        before the start of the fitted motion are extrapolated. If the record ends in motion, the mass moves on after
        the last fitted sample until the law of `oscillator` stops it.

        Raises:
            UsageError: no such run.
        """
        self._check_run(run)
        data, asked = self.runs[run], np.asarray(ts, float) - self.origins[run]
        parameters = {name: jnp.asarray(self.run_parameter(name, run)) for name in data.fixed}
        parameters["t_release"] = parameters["t_release"] - self.origins[run]
        order = np.argsort(asked)
        t, end = asked[order], float(np.max(np.asarray(data.t)))
        # Laws with internal states are integrated in time, without a fixed number of half-cycles.
        goes_on = int(data.half_cycles) >= NEVER and not self.oscillator.friction.n_states
        late = (t > end) & goes_on
        times = np.append(np.where(late, end, t), end) if late.any() else t
        fitted = motion(self.engine_used, self.oscillator, parameters, times, data.half_cycles)
        x = np.array(observe(self.oscillator, fitted, data.observation))[: t.size]
        if late.any():
            x[late] = self._continued(float(fitted.x[-1]), float(fitted.v[-1]), t[late] - end, data.observation)
        read = np.empty(t.size)
        read[order] = x + np.asarray(parameters["offset"] + parameters["drift"] * t)
        return read

    def _continued(self, x0: float, v0: float, after: np.ndarray, observation: Observation) -> np.ndarray:
        """Return readings at times `after` a state, until the law stops it."""
        times, order = np.unique(after, return_inverse=True)
        moved = simulate(self.oscillator, x0, times, v0=v0)
        return np.asarray(observe(self.oscillator, moved, observation))[order]

    def _check_run(self, run: int) -> None:
        if not 0 <= run < len(self.runs):
            raise UsageError(f"There is no run {run}: this fit has {len(self.runs)}, counted from 0.")

    def run_parameter(self, name: str, run: int = 0) -> float:
        """Return a parameter of one run, free or fixed, in record time."""
        for key in (name, f"{name}[{run}]"):
            if key in self.values:
                return self.values[key]
        fixed = float(self.runs[run].fixed[name])
        return fixed + self.origins[run] if name == "t_release" else fixed

    def report(self) -> Report:
        """Report parameters, kinematics, facts about the fit, and warnings."""
        return report_of(self)

    def thumbnails(self) -> Sequence[str]:
        return thumbnails(self)

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"Fit({shown}; {self.status})"

    def plot(self, run: int = 0, *, style: Style = "screen") -> Any:
        """Plot measured and computed trace with residuals; return a matplotlib figure.

        Args:
            run: number of the run in a joint fit.
            style: as of :func:`fricjax.show.styled`.

        Raises:
            UsageError: no such run.
        """
        self._check_run(run)
        return styled(plot(self, run), style)

    def interactive(self, run: int = 0) -> Sliders:
        """Show sliders for the coefficients with the model over the record.

        They are for a notebook. Their values are in `guess` of the returned object, to pass to another fit as start
        values.

        Args:
            run: number of the run in a joint fit.

        Raises:
            UsageError: no such run, or ipywidgets is not installed.
        """
        self._check_run(run)
        return Sliders(self, run)

    def to_dataframe(self) -> Any:
        """Return a pandas table with one row per parameter and kinematic quantity.

        Its columns are `value`, `std`, `combined_std`, `low` and `high` (95 %), `unit` and `remarks`.
        """
        return interchange.to_dataframe(self)

    def to_xarray(self) -> Any:
        """Return an xarray data set of values, covariances and samples.

        Each run has its samples, the model and the residuals.

        Raises:
            UsageError: xarray is not installed.
        """
        return interchange.to_xarray(self)

    def to_uncertainties(self) -> dict[str, Any]:
        """Return the values by name as numbers of the package uncertainties.

        They are correlated by the combined covariance.

        Raises:
            UsageError: the package is not installed.
        """
        return interchange.to_uncertainties(self)

    def to_lmfit(self) -> Any:
        """Convert the fit to lmfit Parameters.

        They contain values with statistical errors, correlations and bounds, and the other coefficients of the machine
        as fixed parameters. Names that lmfit does not accept are written with underscores: ``friction.0.mu`` as
        ``friction_0_mu``. `fit` accepts the result as `free`.

        Raises:
            UsageError: lmfit is not installed.
        """
        return interchange.to_lmfit(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the fit as plain data, without the samples."""
        from .store import to_dict

        return to_dict(self)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the fit with its samples to a JSON file.

        The file is replaced completely or not at all.

        Raises:
            FileExistsError: the file exists and `overwrite` is False.
            OSError: the file cannot be written, for example on a full disk; an existing file is unchanged.
        """
        from .store import save

        return save(self, path, overwrite=overwrite)


def load_fit(path: str | os.PathLike[str]) -> Fit:
    """Read a fit that :meth:`Fit.save` wrote.

    Raises:
        DataError: no such file, or no fit of this schema; the message names the field.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> path = fj.fit(run, machine, ["mu", "damping", "stiffness"]).save("fit.json")
        >>> round(fj.load_fit(path).values["mu"], 6)
        0.05
    """
    from .store import read_fit

    return read_fit(path, Fit)


def named(names: tuple[str, ...], values: Any) -> dict[str, float]:
    """Return values by name."""
    return dict(zip(names, (float(v) for v in values), strict=True))
