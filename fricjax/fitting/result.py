"""The result of a fit: values with honest uncertainties, and everything one needs to judge them."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from ..data.record import labels
from ..errors import UsageError
from ..estimation.covariance import correlation
from ..oscillator import Oscillator, simulate
from ..rig import Measured
from ..show import Report, Reported, Style, styled
from . import interchange
from .diagnostics import optimum_found
from .interactive import Sliders
from .noise import Noise, Whiteness
from .problem import Problem
from .residual import Run, motion
from .rest import Margin
from .show import plot, report_of, thumbnails
from .window import NEVER


class FitError(RuntimeError):
    """A fit without an optimum, or with one that leaves parameters undetermined; as far as it came it is in `fit`.

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
        names: free parameters in the order of the covariance; those of a run carry its number in a joint fit, "x0[2]".
        values, std_errors, combined_std_errors: by name, in SI units. The standard errors come from the noise of the
            record, with the memory, hum, drift and jitter that it shows; the combined ones add the uncertainties of the
            rig's inputs to first order.
        white_std_errors: what the standard errors would be if the noise were white, of the size stated.
        intervals: 95 % intervals from the statistical standard errors, and for the static coefficient of a Coulomb law
            the interval between stops and non-stops. Where these contradict each other it is the range over which
            static friction differs from stop to stop, a flag and a warning say so, and its value is NaN.
        covariance, combined_covariance: shape (p, p); inf where a parameter is undetermined or at a bound.
        units, flags: by name; flags are sentences such as "at bound".
        converged: whether an optimum was found that is finite and of full rank, with no parameter at a bound, and the
            model describes the record: the residuals of no run are larger than ten times its noise
            (`fricjax.thresholds.DESCRIBED`), as stated or as seen in the record.
        status: the outcome in words, its name before the colon: "converged", "does not describe the record", "at a
            bound", "undetermined", "out of steps", "stalled" or "not finite".
        warnings: what a reader of the numbers must know, in sentences.
        kinematics: natural frequency, damping ratio, dead band and losses per unit mass, which need no rig; where one
            is given, with the uncertainties of its inputs.
        inputs: the uncertain inputs of the rig that was given, by name.
        contributions: by name, of parameters and kinematics: how much one standard uncertainty of each input of the rig
            changes the value. A periodic nonlinearity has two, as a cosine and as a sine of the reading.
        chi2, dof, chi2_reduced: sum of squared weighted residuals, degrees of freedom, and their ratio.
        residuals: measured minus model in the unit of the record, NaN where not fitted; a tuple of arrays in a joint
            fit.
        residual_rms: root mean square of the fitted ones.
        sigma, sigma_mode, sigma_source: median noise used, how it was used, and where it came from.
        noise: name of the noise model that was asked for, "auto" for what the record shows.
        noises: the noise of each run as its residuals show it, and as the standard errors count it; drift and hum are
            in `residuals` and not in what `predict` tells.
        whiteness: autocorrelation of the residuals.
        margins: for each run the distance to one half-cycle more or less, None where it ends in motion.
        half_cycles: for each run the number of half-cycles from the start of the fit to the stop, None in motion.
        iterations, passes, stages: steps of Levenberg-Marquardt, each a pass over model and Jacobian; passes over the
            model in all; and stages of growing windows.
        numerical_shift: how far numerical errors can have moved any parameter, in its standard errors: the step that a
            solution of all samples on another mesh would still make.
        engine: name of the engine.
        aicc, bic: information criteria.
        oscillator: the fitted oscillator.
        quantity: "m", or "rad" for a rotary rig.
        sources: name of the file of each run, empty where it has none.
        times: times of the samples [s], one array per run.
        runs, origins: what `predict` needs.
        problem: what was solved, with the records and the settings; None in a fit that was read from a file.

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
    def optimum_found(self) -> bool:
        """Whether an optimum of full rank was found, also where the model misses the record or a bound holds it."""
        return optimum_found(self.status)

    @property
    def labels(self) -> tuple[str, ...]:
        """What the report calls each run: the name of its file, or its number."""
        return labels(self.sources)

    @property
    def residuals_by_run(self) -> tuple[np.ndarray, ...]:
        """The residuals of each run, in a tuple for one run too, as `times` and `runs` are."""
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
        """What the instrument would read at times `ts` of the record [s], with offset and drift, shape (n,).

        Times before the start of the fitted motion are extrapolated. Behind the last fitted sample of a record that
        ends in motion the mass goes on from its state there until the law of `oscillator` stops it.

        Raises:
            UsageError: no such run.
        """
        self._check_run(run)
        data, asked = self.runs[run], np.asarray(ts, float) - self.origins[run]
        parameters = {name: jnp.asarray(self.run_parameter(name, run)) for name in data.fixed}
        parameters["t_release"] = parameters["t_release"] - self.origins[run]
        order = np.argsort(asked)
        t, end = asked[order], float(np.max(np.asarray(data.t)))
        # Laws with internal states are integrated in time, which knows no number of half-cycles.
        goes_on = int(data.half_cycles) >= NEVER and not self.oscillator.friction.n_states
        late = (t > end) & goes_on
        times = np.append(np.where(late, end, t), end) if late.any() else t
        fitted = motion(self.engine_used, self.oscillator, parameters, times, data.half_cycles)
        x = np.array(fitted.x)[: t.size]
        if late.any():
            x[late] = self._continued(float(fitted.x[-1]), float(fitted.v[-1]), t[late] - end)
        read = np.empty(t.size)
        read[order] = x + np.asarray(parameters["offset"] + parameters["drift"] * t)
        return read

    def _continued(self, x0: float, v0: float, after: np.ndarray) -> np.ndarray:
        """Displacement at times `after` a state, stopped by the law."""
        times, order = np.unique(after, return_inverse=True)
        return np.asarray(simulate(self.oscillator, x0, times, v0=v0).x)[order]

    def _check_run(self, run: int) -> None:
        if not 0 <= run < len(self.runs):
            raise UsageError(f"There is no run {run}: this fit has {len(self.runs)}, counted from 0.")

    def run_parameter(self, name: str, run: int = 0) -> float:
        """Value of a parameter of one run, free or fixed, in the record's time."""
        for key in (name, f"{name}[{run}]"):
            if key in self.values:
                return self.values[key]
        fixed = float(self.runs[run].fixed[name])
        return fixed + self.origins[run] if name == "t_release" else fixed

    def report(self) -> Report:
        """Parameters and kinematics with their uncertainties, what the fit rests on, and warnings."""
        return report_of(self)

    def thumbnails(self) -> Sequence[str]:
        return thumbnails(self)

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"Fit({shown}; {self.status})"

    def plot(self, run: int = 0, *, style: Style = "screen") -> Any:
        """Measured and computed trace with residuals, as a matplotlib figure.

        Args:
            run: which run of a joint fit.
            style: as of :func:`fricjax.show.styled`.

        Raises:
            UsageError: no such run.
        """
        self._check_run(run)
        return styled(plot(self, run), style)

    def interactive(self, run: int = 0) -> Sliders:
        """Sliders for the coefficients and the begin of the motion, with the model over the record, for a notebook.

        Their values are in its `guess`, to pass to another fit as start values.

        Args:
            run: which run of a joint fit.

        Raises:
            UsageError: no such run, or ipywidgets is not installed; the sentence says how to.
        """
        self._check_run(run)
        return Sliders(self, run)

    def to_dataframe(self) -> Any:
        """A pandas table of numbers: a row for each parameter, and below them for each quantity of the kinematics.

        Its columns are `value`, `std`, `combined_std`, `low` and `high` (95 %), `unit` and `remarks`.
        """
        return interchange.to_dataframe(self)

    def to_xarray(self) -> Any:
        """A data set of xarray: values and covariances, and the samples of each run with model and residuals.

        Raises:
            UsageError: xarray is not installed; the sentence says how to.
        """
        return interchange.to_xarray(self)

    def to_uncertainties(self) -> dict[str, Any]:
        """The values by name as numbers of the package uncertainties, correlated by the combined covariance.

        Raises:
            UsageError: the package is not installed; the sentence says how to.
        """
        return interchange.to_uncertainties(self)

    def to_lmfit(self) -> Any:
        """Parameters of lmfit: values with statistical errors, correlations and bounds, and the machine as fixed ones.

        Names that lmfit does not take are written with underscores: ``friction.0.mu`` as ``friction_0_mu``. `fit` takes
        them back in place of `free`.

        Raises:
            UsageError: lmfit is not installed; the sentence says how to.
        """
        return interchange.to_lmfit(self)

    def to_dict(self) -> dict[str, Any]:
        """The fit as plain data, without the samples."""
        from .store import to_dict

        return to_dict(self)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the fit with its samples to a JSON file, whole or not at all.

        Raises:
            FileExistsError: there is such a file, and `overwrite` is not given.
            OSError: the file cannot be written, as on a full disk; what was there is as it was.
        """
        from .store import save

        return save(self, path, overwrite=overwrite)


def load_fit(path: str | os.PathLike[str]) -> Fit:
    """Read a fit that :meth:`Fit.save` wrote.

    Raises:
        DataError: no such file, or one that does not hold a fit of this schema; the sentence names the field.

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
    """Values by name."""
    return dict(zip(names, (float(v) for v in values), strict=True))
