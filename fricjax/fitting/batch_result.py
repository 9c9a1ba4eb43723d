"""The result of many independent fits: the fields of a fit with a leading axis over runs."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import DataError, UsageError, nearest
from ..show import Report, Reported, Style, styled
from .diagnostics import optimum_found
from .interchange import batch_to_xarray
from .noise import Noise
from .population import Population, population
from .show import batch_plot, batch_report, batch_thumbnails


@dataclasses.dataclass(frozen=True, eq=False)
class BatchFit(Reported):
    """Independent fits of many runs; rows of runs that could not be fitted hold NaN and say why in `status`.

    Attributes:
        names: free parameters in the order of the covariances.
        values, std_errors: by name, shape (runs,), in SI units; the standard errors count the noise that each run has.
        white_std_errors: what they would be if the noise were white, of the size stated.
        covariance: shape (runs, p, p); inf where a parameter is undetermined or at a bound.
        units: by name.
        converged: whether an optimum was found that describes the run, as of a `Fit`, shape (runs,).
        status: the outcome of each run in words, its name before the colon, as of a `Fit`.
        flags: for each run, by name, sentences such as "at bound".
        warnings: for each run what a reader of its numbers must know, in sentences.
        kinematics, kinematics_std: natural frequency, damping ratio, dead band and losses per unit mass, which need no
            rig, and their standard errors by the noise of each run; by name, shape (runs,).
        contributions: of values and kinematics by name: how much one standard uncertainty of each input of the rig
            changes that of each run, by name of the input, shape (runs,). What one input changes it changes in all runs
            at once.
        chi2, dof: sum of squared weighted residuals and degrees of freedom, shape (runs,).
        residual_rms, sigma: root mean square of the residuals and median noise used, in the unit of the records.
        noises: the noise of each run as its residuals show it, None where it was rejected.
        numerical_shift: how far numerical errors can have moved any parameter, in its standard errors.
        half_cycles: number of half-cycles from the start of the fit to the stop, -1 where a record ends in motion.
        iterations, passes: steps of Levenberg-Marquardt, and passes over the model in all.
        engine: name of the engine.
        sources: name of the file of each run, empty where it has none.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> runs = [fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in (0, 1)]
        >>> batch = fj.fit_batch(runs, machine, ["mu", "damping", "stiffness"])
        >>> batch.to_dataframe()["mu"].round(6).tolist()
        [0.05, 0.05]
        >>> batch.report().facts[0]
        ('runs', '2: 2 converged')
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
    def optimum_found(self) -> np.ndarray:
        """Whether an optimum of full rank was found, also where the model misses the run or a bound holds it."""
        return np.array([optimum_found(status) for status in self.status])

    @property
    def combined_std_errors(self) -> dict[str, np.ndarray]:
        """Standard errors of values and kinematics with the uncertainties of the rig's inputs; by name, shape (runs,).

        Those of different runs are correlated, for the rig is the same.
        """
        noise = {**self.std_errors, **self.kinematics_std}
        return {name: np.linalg.norm([std, *self.contributions[name].values()], axis=0) for name, std in noise.items()}

    @property
    def chi2_reduced(self) -> np.ndarray:
        """Sum of squared weighted residuals per degree of freedom, shape (runs,)."""
        return self.chi2 / self.dof

    def population(self, name: str, *, only_converged: bool = True) -> Population:
        """Mean of a coefficient over the runs and its scatter from run to run, ``mu_i ~ N(mu, s^2)``.

        Runs that cannot belong to the others, as those read in a wrong unit, are set aside and named. What is uncertain
        in the rig, common to all runs, is no scatter and no mean takes it away: it enters the combined standard error
        of the mean alone.

        Args:
            name: a free parameter, or one of the kinematics.
            only_converged: leave out runs that have not converged. With False those whose optimum was found count as
                well: their model does not describe them, or another parameter is at a bound. What the model misses is
                then part of the scatter.

        Raises:
            UsageError: no such name.
            DataError: fewer than three runs that count.
        """
        known = {**self.kinematics, **self.values}
        if name not in known:
            raise UsageError(f"This batch has no {name!r}.{nearest(name, known)} It has {', '.join(known)}.")
        errors = {**self.kinematics_std, **self.std_errors}[name]
        counted = self.converged if only_converged else self.optimum_found
        try:
            return population(np.where(counted, known[name], np.nan), errors, list(self.contributions[name].values()))
        except DataError as error:
            more = int(np.sum(self.optimum_found & ~counted))
            hint = f" {more} have not converged though an optimum was found: only_converged=False counts them."
            raise DataError(f"{error}{hint if more else ''}") from error

    def report(self) -> Report:
        """The parameters of the first runs, their means over all that converged, and how the fits ended."""
        return batch_report(self)

    def thumbnails(self) -> Sequence[str]:
        return batch_thumbnails(self)

    def plot(self, *, style: Style = "screen") -> Any:
        """Each coefficient against the number of its run with its standard error; a matplotlib figure.

        Runs that have not converged are hollow; the line is the mean over the others, and the band the scatter from
        run to run, where there are enough of them to tell it.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        return styled(batch_plot(self), style)

    def to_dataframe(self) -> Any:
        """One row per run: the name of its file, values, their standard errors, and what tells how good they are.

        The standard errors are `<name>_std` and, with the uncertainties of the rig's inputs, `<name>_combined_std`.
        """
        import pandas as pd

        columns: dict[str, Any] = {"source": self.sources}
        noise, combined = {**self.std_errors, **self.kinematics_std}, self.combined_std_errors
        for name, values in {**self.values, **self.kinematics}.items():
            columns |= {name: values, f"{name}_std": noise[name], f"{name}_combined_std": combined[name]}
        for name in _JUDGEMENT:
            columns[name] = getattr(self, name)
        columns["noise"] = [noise and "; ".join(noise.words("")) for noise in self.noises]
        columns |= {"status": self.status, "warnings": [" ".join(warnings) for warnings in self.warnings]}
        return pd.DataFrame(columns).rename_axis("run")

    def to_xarray(self) -> Any:
        """A data set of xarray with the axes `run` and `parameter`.

        Raises:
            UsageError: xarray is not installed; the sentence says how to.
        """
        return batch_to_xarray(self)

    def __repr__(self) -> str:
        return f"BatchFit({len(self)} runs of {', '.join(self.names)}; {int(self.converged.sum())} converged)"


_JUDGEMENT = (
    "chi2_reduced",
    "residual_rms",
    "numerical_shift",
    "half_cycles",
    "passes",
    "converged",
)
