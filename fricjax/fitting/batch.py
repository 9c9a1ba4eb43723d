"""Independent fits of many runs, on all cores, each with its own outcome."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data import Record
from ..data.gather import Source, record_of, sources_of
from ..errors import DataError, UsageError
from ..estimation.covariance import Covariance, covariance
from ..estimation.loss import AbstractLoss
from ..oscillator import Oscillator, ready
from ..oscillator.engines import AbstractEngine
from .assemble import record_time, unit_of
from .batch_result import BatchFit
from .derived import UNITS, Estimate, contributions, kinematics
from .diagnostics import CONVERGED, Misfit, flags_of, misfit_of, status_of, worst
from .lanes import WIDTH, BatchIterate, solve_batch
from .noise_weighting import NoiseWeighted, weigh_by_noise
from .parameters import Request
from .problem import Problem, build_problem
from .rest import far_off, solve_with_rest
from .result import named
from .solve import Solution, solution_of
from .warnings import warnings_of_run
from .window import NEVER


class _Row(NamedTuple):
    """One fitted run; a run that was rejected has a status only."""

    status: str
    problem: Problem | None = None
    counted: NoiseWeighted | None = None
    found: Covariance | None = None
    warnings: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        return self.status == CONVERGED

    @property
    def solution(self) -> Solution | None:
        return None if self.counted is None else self.counted.solution

    @property
    def kinematics(self) -> dict[str, Estimate]:
        if self.solution is None or self.found is None:
            return {}
        return kinematics(self.solution.derived, self.found)

    @property
    def contributions(self) -> dict[str, np.ndarray]:
        if self.problem is None or self.found is None or self.solution is None:
            return {}
        return contributions(self.problem.names, self.solution.derived, self.found)

    @property
    def half_cycles(self) -> int:
        count = NEVER if self.problem is None else int(self.problem.residual.runs[0].half_cycles)
        return -1 if count >= NEVER else count

    @property
    def flags(self) -> dict[str, tuple[str, ...]]:
        if self.problem is None or self.found is None or self.solution is None:
            return {}
        return flags_of(self.problem, self.found, self.solution)


def fit_batch(
    data: Any,
    oscillator: Oscillator,
    free: Sequence[str],
    *,
    t: Any = None,
    rate: float | None = None,
    nuisance: Sequence[str] | None = None,
    engine: str | AbstractEngine = "auto",
    start: str | float = "first_reversal",
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, Any] | None = None,
    tie: Mapping[str, Any] | None = None,
    rig: Any = None,
    guess: Mapping[str, Any] | None = None,
    loss: str | AbstractLoss = "squares",
    progress: bool = False,
) -> BatchFit:
    """Fit the same oscillator to each of many runs independently.

    A run that cannot be fitted never stops the others: its row says why. All cores are used, by threads, so that no
    guard or setting is needed; memory is bounded by the runs that are at work.

    Args:
        data: a list of runs of any lengths, each given as to :func:`fit`: a record, a path, a table,
            ``(t, x)``, and with `t` or `rate` also bare displacements, an array of shape (runs, samples) too.
        oscillator: the machine and its friction law, the same for every run.
        free: names of the coefficients to fit.
        t: times of runs that are given as bare displacements, shape (samples,) in seconds, for all runs or one of each.
        rate: samples per second of such runs, in place of times: ``fit(x, ..., rate=5000.0)``.
        nuisance: names of each run's own parameters; None for those that belong to `start`.
        engine: "auto", "exact", "hybrid", "smooth" or an engine.
        start: "first_reversal", "release" or a number of seconds, as in :func:`fit`.
        bounds: lower and upper bound by name.
        priors: mean and standard deviation by name.
        tie: leaves that follow a free parameter.
        rig: a `Rig` whose uncertain inputs, the same for all runs, enter the combined standard errors to first order.
        guess: start values by name, one number for all runs or an array of shape (runs,).
        loss: loss of the residuals, as in :func:`fit`.
        progress: show a progress bar on stderr.

    Returns:
        The fits, in the order of the runs.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings that fit no run at all.

    ```python
    fricjax.fit_batch(sorted(Path("runs").glob("*.csv")), oscillator, ["mu", "stiffness"]).to_dataframe()
    fricjax.fit_batch(x, oscillator, ["mu", "stiffness"], rate=5000.0)  # x of shape (runs, samples)
    ```
    """
    ready()
    given = sources_of(data, t, rate)
    if not given:
        raise UsageError("There is no run to fit: the list is empty.")
    runs = [_opened(each) for each in given]
    settings = {"nuisance": nuisance, "engine": engine, "start": start, "bounds": bounds, "priors": priors}
    common = Request.of(oscillator, free, tie=tie, rig=rig, guess=None, loss=loss, **settings)
    guesses = _per_run(guess or {}, len(runs))
    order = sorted(range(len(runs)), key=lambda i: _length(runs[i]))
    blocks = [order[first : first + WIDTH] for first in range(0, len(order), WIDTH)]

    def work(block: list[int]) -> list[_Row]:
        return _fit_block([runs[i] for i in block], [common.with_guess(guesses[i]) for i in block])

    rows: dict[int, _Row] = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = pool.map(work, blocks)
        if progress:
            from rich.console import Console
            from rich.progress import track

            results = track(results, "fitting", len(blocks), console=Console(stderr=True))
        for block, found in zip(blocks, results, strict=True):
            rows |= dict(zip(block, found, strict=True))
    names = tuple(_name(each.run, run) for each, run in zip(given, runs, strict=True))
    return _collected([rows[i] for i in range(len(runs))], names)


def _per_run(guess: Mapping[str, Any], runs: int) -> list[dict[str, float]]:
    columns = {}
    for name, values in guess.items():
        if np.ndim(values) and np.shape(values) != (runs,):
            raise UsageError(
                f"Start values of {name} must be one number or one per run ({runs}), got shape {np.shape(values)}."
            )
        columns[name] = np.broadcast_to(np.asarray(values, float), (runs,))
    return [{name: float(values[i]) for name, values in columns.items()} for i in range(runs)]


def _opened(given: Source) -> Record | Exception:
    """The record of a run, or why there is none."""
    try:
        return record_of(given.run, **given.options)
    except (DataError, UsageError) as error:
        return error


def _length(run: Record | Exception) -> int:
    return len(run) if isinstance(run, Record) else 0


def _name(source: Any, run: Record | Exception) -> str:
    """What names a run, also one whose file cannot be read; empty where nothing does."""
    if isinstance(run, Record):
        return run.name
    return Path(source).name if isinstance(source, str | os.PathLike) else ""


def _fit_block(records: Sequence[Any], requests: Sequence[Request]) -> list[_Row]:
    posed = [_posed(record, request) for record, request in zip(records, requests, strict=True)]
    problems = [problem for problem in posed if isinstance(problem, Problem)]
    solution = iter(_solved(problems))
    ended = [next(solution) if isinstance(p, Problem) else p for p in posed]
    return [_row(each) if isinstance(each, _Finished) else _Row(f"rejected: {each}") for each in ended]


def _posed(record: Record | Exception, request: Request) -> Problem | Exception:
    """The problem of one run, or why there is none."""
    if isinstance(record, Exception):
        return record
    try:
        return build_problem((record,), request)
    except (DataError, UsageError) as error:
        return error


class _Finished(NamedTuple):
    """A fit counted by its noise, and its residuals beside that."""

    counted: NoiseWeighted
    misfit: Misfit


def _solved(problems: Sequence[Problem]) -> list[_Finished | UsageError]:
    if any(problem.residual.engine.needs_mesh for problem in problems):
        return [_alone(problem) for problem in problems]
    return [_finished(problem, landed) for problem, landed in zip(problems, solve_batch(problems), strict=True)]


def _alone(problem: Problem) -> _Finished | UsageError:
    """The fit of one run, or why its motion cannot be computed."""
    try:
        counted = weigh_by_noise(*solve_with_rest(problem), True)
    except UsageError as error:
        return error
    return _Finished(counted, _misfit(counted))


def _finished(problem: Problem, landed: BatchIterate) -> _Finished | UsageError:
    """A lane as a solved fit; where its number of half-cycles is in doubt or it is not accurate, fitted for itself."""
    solution = solution_of(problem, landed.at, landed.looked)
    recorded = int(problem.residual.runs[0].half_cycles)
    undecided = bool(problem.windows[0].segmentation.open)
    other = recorded < NEVER and (undecided or 0 < int(landed.told.half_cycles) != recorded)
    doubtful = solution.converged and (other or far_off(problem, solution) or not solution.accurate)
    if doubtful:
        return _alone(problem)
    counted = weigh_by_noise(problem, solution, True)
    # Of a lane no samples are left; where the fit went on by a step they were looked at again.
    if counted.went_on and not counted.solution.evaluation.residual.size:
        return _alone(problem)
    lane = worst(problem, [float(landed.told.size)], [0.0], False)
    return _Finished(counted, _misfit(counted) if counted.went_on else lane)


def _misfit(counted: NoiseWeighted) -> Misfit:
    return misfit_of(counted.problem, counted.solution, counted.noises, False)


def _row(finished: _Finished) -> _Row:
    counted, misfit = finished
    problem, solution = counted.problem, counted.solution
    found = covariance(
        solution.shape, solution.derived.slope, solution.evaluation.normal, counted.variance, counted.unsure
    )
    values, errors = (
        named(problem.names, each) for each in (solution.derived.values, np.sqrt(np.diag(found.statistical)))
    )
    told = tuple(warnings_of_run(problem, values, errors, misfit, counted.others))
    return _Row(status_of(problem, solution, found, misfit), problem, counted, found, told)


def _collected(rows: Sequence[_Row], sources: tuple[str, ...]) -> BatchFit:
    """The rows as columns.

    Raises:
        UsageError: no run could be fitted.
    """
    fitted = [row for row in rows if row.problem is not None]
    if not fitted:
        raise UsageError(f"No run could be fitted. The first was {rows[0].status}")
    problem: Any = fitted[0].problem
    names = problem.names
    covariances = _column(rows, lambda row: row.found.statistical, (len(names), len(names)))
    values = _column(rows, _values, (len(names),))
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    told, parts = [row.kinematics for row in rows], [row.contributions for row in rows]
    return BatchFit(
        names=names,
        values=dict(zip(names, values.T, strict=True)),
        std_errors=dict(zip(names, deviations.T, strict=True)),
        white_std_errors=dict(zip(names, _column(rows, _white_errors, (len(names),)).T, strict=True)),
        covariance=covariances,
        units={p.name: unit_of(p.unit, problem) for p in problem.parameters},
        converged=np.array([row.converged for row in rows]),
        status=tuple(row.status for row in rows),
        flags=tuple(row.flags for row in rows),
        warnings=tuple(row.warnings for row in rows),
        kinematics={name: np.array([t[name].value if t else np.nan for t in told]) for name in UNITS},
        kinematics_std={name: np.array([t[name].std if t else np.nan for t in told]) for name in UNITS},
        contributions={
            name: {
                source: np.array([p[name][i] if p else np.nan for p in parts])
                for i, source in enumerate(problem.inputs)
            }
            for name in (*names, *UNITS)
        },
        chi2=_column(rows, lambda row: row.solution.chi2),
        dof=_column(rows, lambda row: row.problem.dof),
        residual_rms=_column(rows, _rms),
        sigma=_column(rows, _sigma),
        noises=tuple(None if row.counted is None else row.counted.noises[0] for row in rows),
        numerical_shift=_column(rows, lambda row: row.solution.numerical_shift),
        half_cycles=np.array([row.half_cycles for row in rows]),
        iterations=np.array([row.solution.iterations if row.solution else 0 for row in rows]),
        passes=np.array([row.solution.passes if row.solution else 0 for row in rows]),
        engine=type(problem.residual.engine).__name__.lower(),
        sources=sources,
    )


def _column(rows: Sequence[_Row], of: Callable[[Any], Any], shape: tuple[int, ...] = ()) -> np.ndarray:
    """One quantity of all runs, NaN for those that were rejected."""
    return np.array([np.full(shape, np.nan) if row.problem is None else of(row) for row in rows])


def _values(row: Any) -> np.ndarray:
    return record_time(row.problem, row.solution.derived.values)


def _white_errors(row: Any) -> np.ndarray:
    return row.counted.white * row.solution.derived.slope


def _sigma(row: Any) -> float:
    return row.problem.windows[0].stated


def _rms(row: Any) -> float:
    """Root mean square of the residuals, exact where all samples have the same noise."""
    return _sigma(row) * float(np.sqrt(row.solution.chi2 / row.problem.n_used))
