"""Which law describes the runs: several laws fitted to the same samples and judged side by side."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..data import Record, Trace
from ..data.errors import DataError, UsageError, nearest
from ..oscillator import Oscillator, require_x64
from .candidates import Candidate, candidates, law_name
from .cross_validation import held_out_score
from .fingerprints import fingerprints
from .fit import concluded, records_of
from .problem import posed_on
from .residual_tests import ResidualTests, judge
from .rest import solve_with_rest
from .result import Fit

CRITERIA = ("bic", "aicc", "held_out")


@dataclasses.dataclass(frozen=True)
class Row:
    """What one law came to.

    Attributes:
        name, law: what the comparison calls it, and the names of its laws.
        free: coefficients of the machine that were free.
        status: the outcome of its fit in words; `valid`: converged, finite and of full rank; `ended`: at an optimum,
            which a law that contains a better one reaches with coefficients that nothing determines.
        chi2, n_parameters: sum of squared residuals in units of the noise, and number of free parameters, those of
            the runs included.
        chi2_reduced: chi2 per degree of freedom.
        aicc, bic: criteria of the comparison; smaller is better.
        held_out: mean square of the held-out residuals in units of the noise; one for the right law, NaN where
            nothing was held out.
        tests: tests of the residuals, None without a fit.
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
class Comparison:
    """Laws side by side on the same samples.

    Attributes:
        rows: what each law came to, in the order in which they were given.
        criterion: what they are ranked by: "bic", "aicc" or "held_out".
        ranking: their names, best first; laws whose fit found no optimum come last.
        fits: fits by name; without those that were refused.
        n_samples: number of fitted samples, the same for all; `n_effective`: how many independent ones they are worth.
        inflation: variance of the residuals that counts as noise, in units of the stated one (see `compare`).
        fingerprints: what the decay itself says of friction, in sentences.
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
    def best(self) -> Fit:
        """The fit of the law that comes first."""
        return self.fits[self.ranking[0]]

    def row(self, name: str) -> Row:
        """What the law of that name came to.

        Raises:
            UsageError: no such law.
        """
        for row in self.rows:
            if row.name == name:
                return row
        raise UsageError(f"This comparison has no {name!r}.{nearest(name, self.ranking)} It has {self.ranking}.")

    def summary(self) -> str:
        """The comparison as plain text."""
        from .comparison_show import summary

        return summary(self)

    def _repr_html_(self) -> str:
        from .comparison_show import html

        return html(self)

    def __repr__(self) -> str:
        return f"Comparison({' < '.join(self.ranking)} by {self.criterion})"

    def plot(self, run: int = 0) -> Any:
        """Residuals of all laws over time and their distance from the best, as a matplotlib figure."""
        from .comparison_show import plot

        return plot(self, run)

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain data, without the samples."""
        from .comparison_show import to_dict

        return to_dict(self)


def compare(
    data: Record | Trace | Sequence[Record | Trace],
    oscillators: Sequence[Oscillator],
    free: Sequence[Sequence[str]] | None = None,
    *,
    names: Sequence[str] | None = None,
    held_out: bool = True,
    criterion: str = "bic",
    sigma_mode: str = "absolute",
    nuisance: Sequence[str] | None = None,
    engine: Any = "auto",
    start: str | float = "first_reversal",
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, Any] | None = None,
    tie: Mapping[str, Any] | None = None,
    rig: Any = None,
    guess: Mapping[str, float] | None = None,
    loss: Any = "squares",
) -> Comparison:
    """Fit several laws to the same runs and say which describes them best.

    All laws are fitted to the same samples, those that each of them can be fitted to: beside a law that creeps (Tanh)
    the rest is left out for all. The criteria are those for overdispersed data (Burnham and Anderson, Model Selection
    and Multimodel Inference, 2002, section 2.5),

        AICc = chi2/c + 2 k + 2 k (k + 1)/(n/tau - k - 1),      BIC = chi2/c + k ln(n/tau),

    with k free parameters, n samples, and the residuals of the fit of least chi2: their correlation time tau in
    samples, and c = tau times their reduced chi2 (at least one where the noise is taken at its word). For white noise
    as large as stated c and tau are one. Where no law describes the runs, its misfit counts as coloured noise.

    Args:
        data: a record, a trace, or a list of either; several runs are fitted jointly.
        oscillators: the machine with one law after the other.
        free: for each oscillator the names of its free coefficients; None for damping, stiffness and all that a decay
            can tell of the law.
        names: for each oscillator a name; None for that of its law.
        held_out: whether to compute the score of held-out samples (see `fricjax.fitting.cross_validation`).
        criterion: what to rank by: "bic", "aicc" or "held_out".
        sigma_mode: as for `fit`, and so are the following.
        nuisance: each run's own parameters.
        engine: name of the engine, or an engine.
        start: where the motion starts.
        bounds: an entry of this and of the other tables counts for those laws that have its coefficient.
        priors: prior knowledge by name.
        tie: leaves that follow a free parameter.
        rig: the rig whose uncertain inputs enter the combined standard errors.
        guess: start values by name.
        loss: loss of the residuals.

    Returns:
        The comparison. A fit that fails is a row that says so.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or no law that could be fitted.
        DataError: records that cannot be fitted by any law.
    """
    require_x64()
    if criterion not in CRITERIA or (criterion == "held_out" and not held_out):
        raise UsageError(f"There is no ranking by {criterion!r}.{nearest(criterion, CRITERIA)} Choose of {CRITERIA}.")
    machines: tuple[Oscillator, ...] = tuple(oscillators) if isinstance(oscillators, list | tuple) else ()
    if not machines or not all(isinstance(machine, Oscillator) for machine in machines):
        raise UsageError("compare needs a list of oscillators, each the machine with one of the laws.")
    records = records_of(data, sigma_mode)
    tables = {"bounds": bounds, "priors": priors, "tie": tie, "guess": guess}
    settings = {"nuisance": nuisance, "engine": engine, "start": start, "rig": rig, "loss": loss, **tables}
    entered = candidates(records, machines, free, names, settings)
    found = [_fitted(candidate, sigma_mode, held_out) for candidate in entered]
    rows, fits = [row for row, _ in found], {row.name: fit for row, fit in found if fit is not None}
    if not fits:
        raise UsageError(f"No law could be fitted. The first was {rows[0].status}")
    windows = next(candidate.windows for candidate in entered if isinstance(candidate.windows, tuple))
    return _ranked(rows, fits, criterion, sigma_mode, fingerprints(windows, machines[0]))


def _fitted(candidate: Candidate, sigma_mode: str, held_out: bool) -> tuple[Row, Fit | None]:
    """The row of one law, without criteria, and its fit."""
    request = candidate.request
    row = Row(candidate.name, law_name(request.oscillator), request.free, "")
    try:
        if not isinstance(candidate.windows, tuple):
            raise candidate.windows
        problem, solved = solve_with_rest(posed_on(candidate.windows, request))
        fit = concluded(problem, solved, sigma_mode, throw=False)
        score = held_out_score(problem, solved) if held_out and solved.converged else np.nan
    except (DataError, UsageError, RuntimeError) as error:
        return dataclasses.replace(row, status=f"rejected: {' '.join(str(error).split())}"), None
    chi2 = solved.chi2 if np.isfinite(solved.chi2) else np.inf
    times = [np.asarray(window.trace.t)[window.used] for window in problem.windows]
    parts = zip(problem.by_run(solved.survey.residual), problem.windows, strict=True)
    tests = judge(times, [part[window.used] for part, window in parts], fit.kinematics["natural_frequency"].value)
    row = dataclasses.replace(
        row,
        status=fit.status,
        valid=fit.converged,
        ended=solved.converged and bool(np.isfinite(chi2)),
        chi2=chi2,
        n_parameters=len(problem.parameters),
        chi2_reduced=chi2 / problem.dof,
        held_out=score,
        tests=tests,
    )
    return row, fit


def _ranked(
    rows: Sequence[Row], fits: dict[str, Fit], criterion: str, sigma_mode: str, told: tuple[str, ...]
) -> Comparison:
    """The comparison of fitted rows: their criteria, and their order."""
    n = next(int(np.isfinite(_joined(fit)).sum()) for fit in fits.values())
    reference = min((row for row in rows if row.name in fits), key=lambda row: (not row.ended, row.chi2))
    white = reference.tests.whiteness if reference.tests is not None else None
    time = 1.0 if white is None or white.white else white.correlation_time
    scatter = max(reference.chi2_reduced, 1.0) if sigma_mode == "absolute" else reference.chi2_reduced
    effective, inflation = n / time, max(time * scatter, np.finfo(float).tiny)
    judged = tuple(_judged(row, inflation, effective) for row in rows)
    order = sorted(
        judged, key=lambda row: (row.tests is None, not row.ended, _place(getattr(row, criterion)), row.chi2)
    )
    ranking = tuple(row.name for row in order)
    return Comparison(judged, criterion, ranking, fits, n, effective, inflation, told)


def _joined(fit: Fit) -> np.ndarray:
    return np.concatenate(fit.residuals) if isinstance(fit.residuals, tuple) else fit.residuals


def _place(value: float) -> float:
    return np.inf if np.isnan(value) else value


def _judged(row: Row, inflation: float, n: float) -> Row:
    k, misfit = row.n_parameters, row.chi2 / inflation
    aicc = misfit + 2 * k + 2 * k * (k + 1) / max(n - k - 1, 1)
    return dataclasses.replace(row, aicc=float(aicc), bic=float(misfit + k * np.log(n)))
