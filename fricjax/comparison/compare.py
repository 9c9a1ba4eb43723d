"""Comparison of several laws, fitted to the same samples.

All laws are compared with the same noise model.
"""

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, Unpack

import numpy as np

from .. import thresholds
from ..errors import DataError, UsageError
from ..fitting.colours import colours_of, misfit_of, remembered, under_noise
from ..fitting.fit import concluded, records_of
from ..fitting.noise import whiteness
from ..fitting.parameters import Settings, check_known
from ..fitting.problem import Problem, problem_on
from ..fitting.rest import solve_with_rest
from ..fitting.result import Fit
from ..fitting.rows import Seen, rows_of
from ..fitting.solve import Solution
from ..friction.base import law_name
from ..oscillator import Oscillator, cores, one_blas_thread, ready
from ..settings import check_criterion
from ..show.working import working
from .candidates import Candidate, candidates
from .cross_validation import held_out_score
from .fingerprints import fingerprints
from .residual_tests import diagnose
from .result import Comparison, Row


@working("Comparing laws")
@one_blas_thread()
def compare(
    data: object,
    oscillators: Sequence[Oscillator],
    free: Sequence[Sequence[str]] | None = None,
    *,
    names: Sequence[str] | None = None,
    held_out: bool = True,
    criterion: str = "bic",
    **settings: Unpack[Settings],
) -> Comparison:
    """Fit several laws to the same runs and rank them.

    All laws are fitted to the same samples, to which each of them can be fitted. If one law creeps (Tanh), the rest is
    left out for all laws. A law with a much larger chi2 is fitted again from the coefficients of the best law. The
    criteria are those for overdispersed data (Burnham and Anderson, Model Selection and Multimodel Inference, 2002,
    section 2.5),

        AICc = chi2/c + 2 k + 2 k (k + 1)/(n/tau - k - 1),      BIC = chi2/c + k ln(n/tau),

    with k free parameters and n samples. The noise is estimated from the residuals of the fit with the smallest chi2:

    * If it is white, tau is one and c is the reduced chi2 (at least one if the stated noise is absolute).
    * If it is correlated, all laws are compared with this noise model. Then chi2/c is the sum of squares weighted with
      it, and tau its correlation time in samples. Reduced chi2 and residual tests use the weighted residuals, and the
      score of held-out samples is relative to its variance.
    * If no law describes the runs, tau is the correlation time of the residuals, and c is tau times their reduced chi2.

    Args:
        data: a run, or a list of runs, which are fitted jointly; each as for :func:`fricjax.fit`.
        oscillators: the machine, once with each law.
        free: names of the free coefficients of each oscillator; None: damping, stiffness, and all coefficients of the
            law that a decay determines.
        names: name of each oscillator; None: the name of its law.
        held_out: whether to compute the score of held-out samples (see `fricjax.comparison.cross_validation`).
        criterion: criterion of the ranking: "bic", "aicc" or "held_out".
        **settings: settings of :func:`fricjax.fit`, except `throw`. An entry of a table such as `bounds` applies to the
            laws that have the coefficient. The noise model applies to all fits and to the comparison.

    Returns:
        The comparison. A failed fit is a row with a corresponding status.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: the arguments are inconsistent, or no law could be fitted.
        DataError: no law can be fitted to the records.

    Examples:
        Check the calibrated damping of the rig: with one parameter less the run is described equally well.

        >>> import fricjax as fj
        >>> example = fj.data.example_paths()
        >>> machine = fj.Rig.from_toml(example.rig).oscillator(fj.friction.Coulomb(0.02))
        >>> free = [["mu", "stiffness", "damping"], ["mu", "stiffness"]]
        >>> fj.compare(example.run, [machine, machine], free, names=["fitted", "known"], held_out=False)
        Comparison(known < fitted by bic)
    """
    ready()
    of_fits = [name for name in Settings.__annotations__ if name != "throw"]
    check_known("compare", settings, [*of_fits, "names", "held_out", "criterion"])
    check_criterion(criterion, held_out)
    sigma_mode = settings.get("sigma_mode", "absolute")
    machines: tuple[Oscillator, ...] = tuple(oscillators) if isinstance(oscillators, list | tuple) else ()
    if not machines or not all(isinstance(machine, Oscillator) for machine in machines):
        raise UsageError("compare needs a list of oscillators, each the machine with one of the laws.")
    records = records_of(data, settings.get("t"), settings.get("rate"), sigma_mode)
    entered = candidates(records, machines, free, names, settings)
    # Start with the laws with internal states, which take the longest; the others fill the gaps.
    longest_first = sorted(range(len(entered)), key=lambda i: -entered[i].request.oscillator.friction.n_states)
    # The compiler and compiled code release the interpreter lock; an additional thread traces in the meantime.
    with ThreadPoolExecutor(1 + cores()) as pool:

        def side_by_side[S, T](task: Callable[[S], T], of: Sequence[S]) -> list[T]:
            begun = {i: pool.submit(task, of[i]) for i in longest_first}
            return [begun[i].result() for i in range(len(of))]

        def fitted(candidate: Candidate) -> _Entry:
            return _entry(candidate, sigma_mode, held_out)

        first = side_by_side(fitted, entered)
        best = min(first, key=lambda entry: entry.chi2)
        entries = side_by_side(lambda entry: _again(entry, best, fitted), first)
    rows = [entry.row for entry in entries]
    fits = {entry.candidate.name: entry.fit for entry in entries if entry.fit is not None}
    if not fits:
        raise UsageError(f"No law could be fitted. The first was {rows[0].status}")
    reference = _reference_noise(entries, sigma_mode == "absolute")
    rows = tuple(_with_criteria(row, entry, reference) for row, entry in zip(rows, entries, strict=True))

    def place(row: Row) -> tuple:
        value = getattr(row, criterion)
        return row.tests is None, not row.ended, np.inf if np.isnan(value) else value, row.chi2

    ranking = tuple(row.name for row in sorted(rows, key=place))
    windows = next(candidate.windows for candidate in entered if isinstance(candidate.windows, tuple))
    sentences = fingerprints(windows, machines[0])
    return Comparison(rows, criterion, ranking, fits, reference.n, reference.effective, reference.inflation, sentences)


class _Entry(NamedTuple):
    """A candidate with its row, and its fit if there is one."""

    candidate: Candidate
    row: Row
    problem: Problem | None = None
    solution: Solution | None = None
    fit: Fit | None = None

    @property
    def chi2(self) -> float:
        """Sum of squares; inf unless the fit ended at an optimum."""
        solution = self.solution
        if solution is None or not solution.converged or not np.isfinite(solution.chi2):
            return np.inf
        return solution.chi2

    @property
    def frequency(self) -> float:
        """Natural frequency [Hz]; NaN without a fit."""
        return np.nan if self.fit is None else self.fit.kinematics["natural_frequency"].value


def _entry(candidate: Candidate, sigma_mode: str, held_out: bool) -> _Entry:
    """Fit a candidate; of the criteria, only the held-out score is set."""
    request = candidate.request
    row = Row(candidate.name, law_name(request.oscillator.friction), request.free, "")
    try:
        if not isinstance(candidate.windows, tuple):
            raise candidate.windows
        problem, solution = solve_with_rest(problem_on(candidate.windows, request))
        fit = concluded(problem, solution, sigma_mode, throw=False, trials=False)
    except (DataError, UsageError, RuntimeError) as error:
        return _Entry(candidate, dataclasses.replace(row, status=f"rejected: {' '.join(str(error).split())}"))
    entry = _Entry(candidate, row, problem, solution, fit)
    chi2 = solution.chi2 if np.isfinite(solution.chi2) else np.inf
    times = [np.asarray(window.trace.t)[window.used] for window in problem.windows]
    parts = zip(problem.by_run(solution.evaluation.residual), problem.windows, strict=True)
    row = dataclasses.replace(
        row,
        status=fit.status,
        valid=fit.described,
        ended=np.isfinite(entry.chi2),
        chi2=chi2,
        n_parameters=len(problem.parameters),
        chi2_reduced=chi2 / problem.dof,
        held_out=held_out_score(problem, solution) if held_out and solution.converged else np.nan,
        tests=diagnose(times, [part[window.used] for part, window in parts], entry.frequency),
    )
    return entry._replace(row=row)


def _again(entry: _Entry, best: _Entry, fitted: Callable[[Candidate], _Entry]) -> _Entry:
    """Fit a law again from the coefficients of the best one.

    A law with a much larger chi2 gets this second fit, so no law is rejected because of a poor start. The better of the
    two entries is returned.
    """
    known = {} if best.fit is None else {name: v for name, v in best.fit.values.items() if np.isfinite(v)}
    request = entry.candidate.request
    guess = {name: known[name] for name in request.free if name in known} | dict(request.guess)
    behind = best.chi2 * thresholds.EXCESS < entry.chi2
    if not (behind and isinstance(entry.candidate.windows, tuple) and guess != request.guess):
        return entry
    second = fitted(dataclasses.replace(entry.candidate, request=request.with_guess(guess)))
    return min(entry, second, key=lambda one: one.chi2)


class _ReferenceNoise(NamedTuple):
    """The noise with which all laws are compared.

    Attributes:
        n: number of samples.
        effective: number of independent samples.
        scatter: variance of the residuals, in units of the stated noise.
        inflation: `scatter` times the number of samples per independent sample; it divides a sum over all samples.
        seen: rows and noise model of each run; empty if the noise is white or if no law describes the runs.
    """

    n: int
    effective: float
    scatter: float
    inflation: float
    seen: Sequence[Seen]


def _reference_noise(entries: Sequence[_Entry], absolute: bool) -> _ReferenceNoise:
    """Estimate the noise from the fit with the smallest chi2."""
    best = min(
        (entry for entry in entries if entry.fit is not None), key=lambda entry: (entry.chi2, entry.candidate.name)
    )
    problem, solution = best.problem, best.solution
    assert problem is not None and solution is not None
    evaluation, time = solution.evaluation, 1.0
    seen = colours_of(problem, solution, rows_of(problem, evaluation), absolute) if solution.converged else []
    scatter = max(solution.chi2 / problem.dof, 1.0 if absolute else np.finfo(float).tiny)
    if seen and misfit_of(problem, seen, absolute) <= thresholds.DESCRIBED:
        time = max(remembered(*run) for run in seen)
    elif seen:
        # If no law describes the runs, the residuals are not noise and cannot weight the laws.
        seen, time = [], max(whiteness(part).correlation_time for part in problem.by_run(evaluation.residual))
    return _ReferenceNoise(problem.n_used, problem.n_used / time, scatter, time * scatter, seen)


def _with_criteria(row: Row, entry: _Entry, noise: _ReferenceNoise) -> Row:
    if entry.problem is None or entry.solution is None or not np.isfinite(row.chi2):
        return row
    k, n, misfit = row.n_parameters, noise.effective, row.chi2 / noise.inflation
    if noise.seen and entry.fit is not None:
        counted = under_noise(entry.problem, entry.solution, noise.seen)
        misfit = counted.misfit
        row = dataclasses.replace(
            row,
            chi2_reduced=misfit / (sum(part.size for part in counted.residuals) - k),
            held_out=row.held_out / noise.scatter,
            tests=diagnose(counted.times, counted.residuals, entry.frequency),
        )
    aicc = misfit + 2 * k + 2 * k * (k + 1) / max(n - k - 1, 1)
    return dataclasses.replace(row, aicc=float(aicc), bic=float(misfit + k * np.log(n)))
