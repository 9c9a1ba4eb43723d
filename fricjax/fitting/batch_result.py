"""Results of a batch: the fields of a fit for all runs."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import DataError, UsageError, nearest
from ..show import Report, Reported, Style, styled
from ..show.tables import dataframe
from .diagnostics import describes, optimum_found
from .interchange import batch_to_xarray
from .noise import Noise
from .population import Population, population
from .show import batch_plot, batch_report, batch_thumbnails


@dataclasses.dataclass(frozen=True, eq=False)
class BatchFit(Reported):
    """Independent fits of many runs; rejected runs hold NaN.

    The status of a rejected run gives the reason.

    Attributes:
        names: free parameters in the order of the covariances.
        values, std_errors: by name, shape (runs,), in SI units. Standard errors follow from the noise of each run.
        white_std_errors: standard errors for white noise of the stated level.
        covariance: shape (runs, p, p); inf for a parameter that is undetermined or at a bound.
        units: by name.
        converged: True for runs with an optimum of full rank, as in a `Fit`, shape (runs,).
        status: the outcome of each run in words, its name before the colon, as in a `Fit`.
        flags: for each run, by name, remarks such as "at bound".
        warnings: for each run, in sentences.
        kinematics, kinematics_std: natural frequency, damping ratio, dead band and losses per unit mass, which need no
            rig, and their standard errors from the noise of each run; by name, shape (runs,).
        contributions: by name of a value or kinematic quantity: its change per standard uncertainty of each input of
            the rig, by name of the input, shape (runs,). One input changes all runs at once.
        chi2, dof: sum of squared weighted residuals and degrees of freedom, shape (runs,).
        residual_rms, sigma: root mean square of the residuals and median noise used, in the unit of the records.
        noises: noise of each run as its residuals show it; None for a rejected run.
        numerical_shift: largest change of a parameter by numerical errors, in standard errors.
        half_cycles: number of half-cycles from the start of the fit to the stop; -1 if a record ends in motion.
        iterations, passes: steps of Levenberg-Marquardt, and evaluations of the model in total.
        engine: name of the engine.
        sources: file name of each run; empty if unknown.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> runs = [fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in (0, 1)]
        >>> batch = fj.fit_batch(runs, machine, ["mu", "damping", "stiffness"])
        >>> batch.to_dataframe()["mu"].round(6).tolist()
        [0.05, 0.05]
        >>> batch.report().facts[0]
        ('runs', '2: 2 described')
    """

    names: tuple[str, ...]
    values: dict[str, np.ndarray]
    std_errors: dict[str, np.ndarray]
    white_std_errors: dict[str, np.ndarray]
    covariance: np.ndarray
    units: dict[str, str]
    converged: np.ndarray
    status: tuple[str, ...]
    flags: tuple[dict[str, tuple[str, ...]], ...]
    warnings: tuple[tuple[str, ...], ...]
    kinematics: dict[str, np.ndarray]
    kinematics_std: dict[str, np.ndarray]
    contributions: dict[str, dict[str, np.ndarray]]
    chi2: np.ndarray
    dof: np.ndarray
    residual_rms: np.ndarray
    sigma: np.ndarray
    noises: tuple[Noise | None, ...]
    numerical_shift: np.ndarray
    half_cycles: np.ndarray
    iterations: np.ndarray
    passes: np.ndarray
    engine: str
    sources: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.status)

    @property
    def described(self) -> np.ndarray:
        """True for runs that the model describes, shape (runs,)."""
        return np.array([describes(status) for status in self.status])

    @property
    def optimum_found(self) -> np.ndarray:
        """True for runs with an optimum of full rank, shape (runs,).

        Such a fit may still miss the record or end at a bound.
        """
        return np.array([optimum_found(status) for status in self.status])

    @property
    def combined_std_errors(self) -> dict[str, np.ndarray]:
        """Standard errors including the uncertain inputs of the rig.

        They cover values and kinematics, by name, shape (runs,). Those of different runs are correlated, because all
        runs share the rig.
        """
        noise = {**self.std_errors, **self.kinematics_std}
        return {name: np.linalg.norm([std, *self.contributions[name].values()], axis=0) for name, std in noise.items()}

    @property
    def chi2_reduced(self) -> np.ndarray:
        """Sum of squared weighted residuals per degree of freedom, shape (runs,)."""
        return self.chi2 / self.dof

    def population(self, name: str, *, only_described: bool = True) -> Population:
        """Estimate mean and scatter of a coefficient over the runs.

        The model is ``mu_i ~ N(mu, s^2)``. Runs that are inconsistent with the others, such as those read in a wrong
        unit, are excluded and named. All runs share the rig, so its uncertainty is no scatter and does not average out:
        it enters only the combined standard error of the mean.

        Args:
            name: a free parameter, or one of the kinematics.
            only_described: use only runs that the model describes. If False, also use runs with an optimum that does
                not describe the record or has another parameter at a bound. Model errors then add to the scatter.

        Raises:
            UsageError: no such name.
            DataError: fewer than three usable runs.
        """
        known = {**self.kinematics, **self.values}
        if name not in known:
            raise UsageError(f"This batch has no {name!r}.{nearest(name, known)} It has {', '.join(known)}.")
        errors = {**self.kinematics_std, **self.std_errors}[name]
        counted = self.described if only_described else self.optimum_found
        try:
            return population(np.where(counted, known[name], np.nan), errors, list(self.contributions[name].values()))
        except DataError as error:
            more = int(np.sum(self.optimum_found & ~counted))
            hint = f" {more} are not described though an optimum was found: only_described=False counts them."
            raise DataError(f"{error}{hint if more else ''}") from error

    def report(self) -> Report:
        """Report the first runs, the means over described runs, and the outcomes."""
        return batch_report(self)

    def thumbnails(self) -> Sequence[str]:
        return batch_thumbnails(self)

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot each coefficient with its standard error against the run number.

        Runs that are not described are hollow. The line is the mean over the others; the band is the scatter between
        runs, if there are enough runs to estimate it.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        return styled(batch_plot(self), style)

    def to_dataframe(self) -> Any:
        """Return one row per run: file name, values, standard errors, fit quality.

        The standard errors are `<name>_std` and, with the uncertainties of the rig's inputs, `<name>_combined_std`.
        """
        columns: dict[str, Any] = {"source": self.sources}
        noise, combined = {**self.std_errors, **self.kinematics_std}, self.combined_std_errors
        for name, values in {**self.values, **self.kinematics}.items():
            columns |= {name: values, f"{name}_std": noise[name], f"{name}_combined_std": combined[name]}
        for name in _JUDGEMENT:
            columns[name] = getattr(self, name)
        columns["noise"] = [noise and "; ".join(noise.words("")) for noise in self.noises]
        columns |= {"status": self.status, "warnings": [" ".join(warnings) for warnings in self.warnings]}
        endings = ("", "_std", "_combined_std")
        units = {f"{name}{end}": unit for name, unit in self.units.items() for end in endings}
        return dataframe(columns, units).rename_axis("run")

    def to_xarray(self) -> Any:
        """Return an xarray data set with the axes `run` and `parameter`.

        Raises:
            UsageError: xarray is not installed.
        """
        return batch_to_xarray(self)

    def __repr__(self) -> str:
        return f"BatchFit({len(self)} runs of {', '.join(self.names)}; {int(self.described.sum())} described)"


_JUDGEMENT = (
    "chi2_reduced",
    "residual_rms",
    "numerical_shift",
    "half_cycles",
    "passes",
    "converged",
    "described",
)
