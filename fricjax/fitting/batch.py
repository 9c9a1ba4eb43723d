"""Fit many runs independently, on all cores."""

import functools
import os
from collections.abc import Mapping, Sequence
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
from .derived import contributions, kinematics
from .diagnostics import Misfit, flags_of, misfit_of, with_faults, worst
from .noise_weighting import NoiseWeighted, weigh_by_noise
from .parameters import Free, Request, RunSettings, check_known
from .plain import plain_runs
from .problem import Problem, build_problem
from .rest import miscounted, solve_with_rest, stops_within
from .result import named
from .run_fit import RunFit, collected
from .sketch import sketch
from .solve import Solution, solve_batch
from .tabulate import untabulated
from .trials.outcome import conclude
from .trials.refits import alternatives
from .warnings import warnings_of_run
from .window import NEVER


class Row(NamedTuple):
    """One solved run; a rejected run has only a status.

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

    def numbers(self, engine: str) -> RunFit:
        """Return the numbers of the fit.

        The root mean square of the residuals is exact if all samples have the same noise.
        """
        problem, weighted, covariances, misfit, of_trials = self[1:]
        if problem is None or weighted is None or covariances is None or misfit is None:
            return RunFit(self.status)
        solution, window = weighted.solution, problem.windows[0]
        derived = solution.derived
        values = named(problem.names, derived.values)
        count = int(problem.residual.runs[0].half_cycles)
        return RunFit(
            status=self.status,
            units={p.name: unit_of(p, problem) for p in problem.parameters},
            inputs=tuple(problem.inputs),
            values=derived.values + problem.origins,
            white=weighted.white * derived.slope,
            covariance=covariances.statistical,
            kinematics=[(each.value, each.std) for each in kinematics(derived, covariances).values()],
            contributions=list(contributions(problem.names, derived, covariances).values()),
            flags=flags_of(problem, covariances, solution),
            warnings=(
                *of_trials,
                *warnings_of_run(problem, values, misfit, weighted.others),
            ),
            chi2=solution.chi2,
            dof=problem.dof,
            residual_rms=window.stated * float(np.sqrt(solution.chi2 / problem.n_used)),
            sigma=window.stated,
            noise=weighted.noises[0],
            numerical_shift=solution.numerical_shift,
            half_cycles=-1 if count >= NEVER else count,
            iterations=solution.iterations,
            passes=solution.passes,
            engine=engine,
            segmentation=window.segmentation,
            load=float(problem.residual.oscillator.normal_force),
            sketch=functools.partial(sketch, problem, solution),
        )


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

    def work(block: list[int]) -> list[RunFit]:
        rows = fit_rows([runs[i] for i in block], [common.with_guess(guesses[i]) for i in block])
        # The samples of a run are not kept.
        return [row._replace(segmentation=None, sketch=None) for row in rows]

    rows: dict[int, RunFit] = {}
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
def fit_rows(records: Sequence[Any], requests: Sequence[Request]) -> list[RunFit]:
    """Fit runs in this thread; equal shapes share one computation.

    Args:
        records: a record for each run, or the `DataError` or `UsageError` raised when it was read.
        requests: one for each run. All have the same law and loss; the machines may differ.
    """
    rows, problems = dict[int, RunFit](), dict[int, Problem]()
    for i, plain in plain_runs(records, requests).items():
        if isinstance(plain, NoiseWeighted):
            misfit = misfit_of(plain.problem, plain.solution, plain.noises, False)
            plain = _row(plain, misfit).numbers("exact")
        rows[i] = plain
    for i, (record, request) in enumerate(zip(records, requests, strict=True)):
        if i in rows:
            continue
        try:
            if isinstance(record, Exception):
                raise record
            problems[i] = build_problem((record,), request)
        except (DataError, UsageError) as error:
            rows[i] = RunFit(f"rejected: {error}")
    several = not alone(list(problems.values()))
    for i, row in zip(problems, solved_rows(list(problems.values())), strict=True):
        # Only a run that is solved alone is solved by tables.
        residual = untabulated(problems[i].residual) if several else problems[i].residual
        rows[i] = row.numbers(type(residual.engine).__name__.lower())
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
