"""Fit many runs independently, on all cores."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..data import Record
from ..data.gather import Source, record_of, sources_of
from ..errors import DataError, UsageError
from ..estimation.covariance import Covariance, covariance
from ..oscillator import Oscillator, cores, one_at_a_time, one_blas_thread, ready
from ..show.working import working
from .assemble import unit_of
from .batch_result import BatchFit
from .chunks import blocks
from .derived import UNITS, contributions, kinematics
from .diagnostics import Misfit, flags_of, misfit_of, optimum_found, with_faults, worst
from .noise_weighting import NoiseWeighted, weigh_by_noise
from .parameters import Free, Request, RunSettings, check_known
from .problem import Problem, build_problem
from .rest import miscounted, solve_with_rest, stops_within
from .result import named
from .solve import Solution, solve_batch
from .tabulate import untabulated
from .trials.outcome import conclude
from .trials.refits import alternatives
from .warnings import warnings_of_run
from .window import NEVER


class Row(NamedTuple):
    """One run of a batch; a rejected run has only a status.

    Attributes:
        status: the outcome in words.
        problem, weighted, covariances, misfit, of_trials: intermediate results of a fitted run.
    """

    status: str
    problem: Problem | None = None
    weighted: NoiseWeighted | None = None
    covariances: Covariance | None = None
    misfit: Misfit | None = None
    of_trials: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about this run, in sentences; computed at each access."""
        if self.problem is None or self.weighted is None or self.covariances is None or self.misfit is None:
            return ()
        values = named(self.problem.names, self.weighted.solution.derived.values)
        return (*self.of_trials, *warnings_of_run(self.problem, values, self.misfit, self.weighted.others))


@one_blas_thread()
def fit_batch(
    data: object,
    oscillator: Oscillator,
    free: Free,
    *,
    guess: Mapping[str, ArrayLike] | None = None,
    **settings: Unpack[RunSettings],
) -> BatchFit:
    """Fit the same oscillator to each of many runs independently.

    A run that cannot be fitted does not stop the others: its status gives the reason. The runs are distributed over
    threads on all cores. Memory use depends on the number of runs in progress, not on the number of runs.

    Args:
        data: a list of runs of any lengths, each given as to :func:`fit`: a record, a path, a table,
            ``(t, x)``, and with `t` or `rate` also bare displacements, an array of shape (runs, samples) too.
        oscillator: the machine and its friction law, the same for every run.
        free: names of the coefficients to fit, or Parameters of lmfit, as in :func:`fit`.
        guess: start values by name, one number for all runs or an array of shape (runs,).
        **settings: as for :func:`fit`, except `sigma_mode` and `throw`; the same for all runs.

    Returns:
        The fits, in the order of the runs.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings that fit no run at all.

    ```python
    fricjax.fit_batch(sorted(Path("runs").glob("*.csv")), oscillator, ["mu", "stiffness"]).to_dataframe()
    fricjax.fit_batch(x, oscillator, ["mu", "stiffness"], rate=5000.0)  # x of shape (runs, samples)
    ```

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> runs = [fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in (0, 1)]
        >>> batch = fj.fit_batch(runs, machine, ["mu", "damping", "stiffness"])
        >>> batch.converged.tolist(), batch.values["mu"].round(6).tolist()
        ([True, True], [0.05, 0.05])
    """
    ready()
    check_known("fit_batch", settings, (*RunSettings.__annotations__, "guess"))
    sources = sources_of(data, settings.get("t"), settings.get("rate"))
    if not sources:
        raise UsageError("There is no run to fit: the list is empty.")
    runs = [_opened(each) for each in sources]
    common = Request.of(oscillator, free, **settings)
    guesses = _per_run(guess or {}, len(runs))
    order = sorted(range(len(runs)), key=lambda i: len(run) if isinstance(run := runs[i], Record) else 0)
    parts = [[order[i] for i in block] for block in blocks(len(order))]

    def work(block: list[int]) -> list[Row]:
        return fit_rows([runs[i] for i in block], [common.with_guess(guesses[i]) for i in block])

    rows: dict[int, Row] = {}
    with working("Fitting runs", len(runs)) as task, ThreadPoolExecutor(cores()) as pool:
        for block, rows_of_block in zip(parts, pool.map(work, parts), strict=True):
            rows |= dict(zip(block, rows_of_block, strict=True))
            task.advance(len(block))
    names = tuple(_name(each.run, run) for each, run in zip(sources, runs, strict=True))
    return collected([rows[i] for i in range(len(runs))], names)


def _per_run(guess: Mapping[str, ArrayLike], runs: int) -> list[dict[str, float]]:
    columns = {}
    for name, values in guess.items():
        if np.ndim(values) and np.shape(values) != (runs,):
            raise UsageError(
                f"Start values of {name} must be one number or one per run ({runs}), got shape {np.shape(values)}."
            )
        columns[name] = np.broadcast_to(np.asarray(values, float), (runs,))
    return [{name: float(values[i]) for name, values in columns.items()} for i in range(runs)]


def _opened(source: Source) -> Record | Exception:
    """Return the record of a run, or the error of reading it."""
    try:
        return record_of(source.run, **source.options)
    except (DataError, UsageError) as error:
        return error


def _name(source: Any, run: Record | Exception) -> str:
    """Return the name of a run from its record or path."""
    if isinstance(run, Record):
        return run.name
    return Path(source).name if isinstance(source, str | os.PathLike) else ""


@one_at_a_time()
def fit_rows(records: Sequence[Any], requests: Sequence[Request]) -> list[Row]:
    """Fit runs in this thread; equal shapes share one compiled computation.

    Args:
        records: a record for each run, or the `DataError` or `UsageError` raised when it was read.
        requests: one for each run. All have the same law and loss; the machines may differ.
    """
    rows, problems = dict[int, Row](), dict[int, Problem]()
    for i, (record, request) in enumerate(zip(records, requests, strict=True)):
        try:
            if isinstance(record, Exception):
                raise record
            problems[i] = build_problem((record,), request)
        except (DataError, UsageError) as error:
            rows[i] = Row(f"rejected: {error}")
    solved = solved_rows(list(problems.values()))
    rows |= dict(zip(problems, solved, strict=True))
    return [rows[i] for i in range(len(records))]


def solved_rows(problems: Sequence[Problem], begins: Sequence[np.ndarray] | None = None) -> list[Row]:
    """Solve each problem independently and weight its residuals by their noise.

    Args:
        problems: problems with the same engine and loss.
        begins: initial coordinates of each; None for the start values.
    """
    solutions = [None] * len(problems) if alone(problems) else solve_batch(problems, begins)
    rows = []
    for problem, solved, begin in zip(problems, solutions, begins or [None] * len(problems), strict=True):
        try:
            rows.append(_row(*_weighted(problem, solved, begin)))
        except UsageError as error:  # a motion that cannot be computed
            rows.append(Row(f"rejected: {error}"))
    return rows


def alone(problems: Sequence[Problem]) -> bool:
    """Return True if problems must be solved one by one, like `fit`.

    These are a single problem, joint fits, and engines that need a mesh.
    """
    return len(problems) == 1 or any(each.residual.engine.needs_mesh or len(each.windows) > 1 for each in problems)


def _weighted(
    problem: Problem, solved: tuple[Solution, Any] | None, begin: np.ndarray | None
) -> tuple[NoiseWeighted, Misfit]:
    """Return the weighted fit of one problem, and its misfit.

    A run is solved again individually if its number of half-cycles is uncertain or the solution of the chunk is
    inaccurate.
    """
    if solved is not None:
        solution, sizes = solved
        recorded = int(problem.residual.runs[0].half_cycles)
        undecided = bool(problem.windows[0].segmentation.open)
        stops = problem.residual.oscillator.friction.set_valued
        other = recorded < NEVER and (undecided or (stops and stops_within(problem, solution, 0) != recorded))
        if not (solution.converged and (other or miscounted(problem, solution) or not solution.accurate)):
            weighted = weigh_by_noise(problem, solution, True)
            if not weighted.went_on:
                return weighted, worst(problem, [sizes], [0.0], False)
            # A chunk keeps no residuals of its samples; a fit that took a further step has evaluated them again.
            if weighted.solution.evaluation.residual.size:
                return weighted, misfit_of(weighted.problem, weighted.solution, weighted.noises, False)
    weighted = weigh_by_noise(*solve_with_rest(problem, begin), True)
    return weighted, misfit_of(weighted.problem, weighted.solution, weighted.noises, False)


def _row(weighted: NoiseWeighted, misfit: Misfit) -> Row:
    problem, solution = weighted.problem, weighted.solution
    misfit = with_faults(problem, misfit)
    matrices = solution.shape, solution.derived.slope, solution.evaluation.normal, weighted.variance
    outcome = conclude(weighted, covariance(*matrices, weighted.unsure), misfit, alternatives(weighted))
    covariances = covariance(*matrices, weighted.unsure + outcome.additional)
    return Row(outcome.status, problem, weighted, covariances, misfit, outcome.warnings)


def _engine_of(problem: Problem, runs: int) -> str:
    """Return the name of the engine.

    Only a single run is solved by tables.
    """
    residual = problem.residual if runs == 1 else untabulated(problem.residual)
    return type(residual.engine).__name__.lower()


def collected(rows: Sequence[Row], sources: tuple[str, ...]) -> BatchFit:
    """Collect the rows into columns.

    All runs must have the same free parameters and uncertain inputs. The root mean square of the residuals is exact if
    all samples of a run have the same noise.

    Raises:
        UsageError: no run could be fitted.
    """
    fitted = [row for row in rows if row.problem is not None]
    if not fitted:
        raise UsageError(f"No run could be fitted. The first was {rows[0].status}")
    problem: Any = fitted[0].problem
    names, p = problem.names, len(problem.names)

    def column(of: Callable[[Any, Any, Any], Any], shape: tuple[int, ...] = (), absent: Any = np.nan) -> np.ndarray:
        """Evaluate `of` for each run; rejected runs get `absent`."""
        return np.array(
            [np.full(shape, absent) if row.problem is None else of(row.problem, row.weighted, row.covariances)
             for row in rows]
        )  # fmt: skip

    def by_name(values: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(names, values.T, strict=True))

    def estimates(_: Problem, weighted: NoiseWeighted, covariances: Covariance) -> list[tuple[float, float]]:
        return [(e.value, e.std) for e in kinematics(weighted.solution.derived, covariances).values()]

    def parts(problem: Problem, weighted: NoiseWeighted, covariances: Covariance) -> list[np.ndarray]:
        return list(contributions(problem.names, weighted.solution.derived, covariances).values())

    covariances = column(lambda _, __, covariances: covariances.statistical, (p, p))
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    trace = column(estimates, (len(UNITS), 2))
    shares = column(parts, (p + len(UNITS), len(problem.inputs)))
    return BatchFit(
        names=names,
        values=by_name(column(lambda p, w, _: w.solution.derived.values + p.origins, (p,))),
        std_errors=by_name(deviations),
        white_std_errors=by_name(column(lambda _, w, __: w.white * w.solution.derived.slope, (p,))),
        covariance=covariances,
        units={p.name: unit_of(p.unit, problem) for p in problem.parameters},
        converged=np.array([optimum_found(row.status) for row in rows]),
        status=tuple(row.status for row in rows),
        flags=tuple(
            {}
            if row.problem is None or row.weighted is None or row.covariances is None
            else flags_of(row.problem, row.covariances, row.weighted.solution)
            for row in rows
        ),
        warnings=tuple(row.warnings for row in rows),
        kinematics={name: trace[:, i, 0] for i, name in enumerate(UNITS)},
        kinematics_std={name: trace[:, i, 1] for i, name in enumerate(UNITS)},
        contributions={
            name: {source: shares[:, i, j] for j, source in enumerate(problem.inputs)}
            for i, name in enumerate((*names, *UNITS))
        },
        chi2=column(lambda _, w, __: w.solution.chi2),
        dof=column(lambda p, *_: p.dof),
        residual_rms=column(lambda p, w, _: p.windows[0].stated * np.sqrt(w.solution.chi2 / p.n_used)),
        sigma=column(lambda p, *_: p.windows[0].stated),
        noises=tuple(None if row.weighted is None else row.weighted.noises[0] for row in rows),
        numerical_shift=column(lambda _, w, __: w.solution.numerical_shift),
        half_cycles=column(_half_cycles, absent=-1),
        iterations=column(lambda _, w, __: w.solution.iterations, absent=0),
        passes=column(lambda _, w, __: w.solution.passes, absent=0),
        engine=_engine_of(problem, len(fitted)),
        sources=sources,
    )


def _half_cycles(problem: Problem, *_: Any) -> int:
    """Return the number of half-cycles to the stop; -1 without one."""
    count = int(problem.residual.runs[0].half_cycles)
    return -1 if count >= NEVER else count
