"""Reading and fitting one chunk of files into table rows.

Runs of equal shape share a compiled program. No file raises an error here: each run gets a row that gives its outcome.
"""

import dataclasses
import hashlib
import os
import platform
import time
import traceback
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..data import Record, read
from ..data.files import gigabytes, printable
from ..errors import DataError, UsageError
from ..fitting.batch import Row, collected, fit_rows
from ..fitting.diagnostics import CONVERGED
from ..fitting.names import of_run
from ..fitting.sketch import few, sketches
from ..fitting.window import equilibrium
from ..oscillator import one_at_a_time
from .plan import LARGEST_FILE, Chunk, Job, hash_of, iso_time, settings_of, signature_of
from .study import SCHEMA, Law, Rule, Study, versions
from .table import netcdf

if TYPE_CHECKING:
    from ..fitting.batch_result import BatchFit

_REJECTED = "rejected: "


class Done(NamedTuple):
    """Result of a chunk.

    Attributes:
        rows: a mapping of columns for each run and law, without null values.
        residuals: netCDF files by the key of their run, if requested.
    """

    rows: list[dict[str, Any]]
    residuals: dict[str, bytes]


class WorkerDied(RuntimeError):
    """End of a worker process, with the outcome for its row."""


@dataclasses.dataclass(frozen=True)
class _Run:
    """Run of a file, or its read error, with the known columns."""

    job: Job
    record: Record | Exception
    columns: Mapping[str, Any]


@dataclasses.dataclass(frozen=True)
class Work:
    """Work on a chunk, picklable for workers.

    Attributes:
        study: the study.
    """

    study: Study

    def __call__(self, chunk: Chunk) -> Done:
        """Read and fit the files of a chunk."""
        runs = [run for job in chunk.jobs for run in self._read(job)]
        done = Done([], {})
        for number in sorted({number for job in chunk.jobs for number in job.laws}):
            of_law = [run for run in runs if number in run.job.laws]
            self._fit(self.study.laws[number], of_law, done)
        return done

    def failed(self, chunk: Chunk, error: Exception) -> Done:
        """Return failed rows for a chunk that raised an unexpected error."""
        runs = [_Run(job, error, self._columns(job, "")) for job in chunk.jobs]
        pairs = [(self.study.laws[number], run) for run in runs for number in run.job.laws]
        return Done([self._row(law, run, *_outcome(error)) for law, run in pairs], {})

    def _read(self, job: Job) -> list[_Run]:
        """Read the runs of a file."""
        started = time.perf_counter()
        path = self.study.root / job.file
        sha256 = hash_of(path)
        columns = self._columns(job, sha256)
        records: Sequence[Record | Exception]
        try:
            _check_file(self.study, job)
            records = _records(path, self.study.rule_of(job.file))
            if signature_of(path) != job.signature and hash_of(path) != sha256:
                raise DataError(f"{path.name} was written to while it was read. Start again when it is complete.")
        except Exception as error:
            records = [error]
        seconds = (time.perf_counter() - started) / len(records)
        return [_Run(job, record, {**columns, **_facts_of(record), "seconds_read": seconds}) for record in records]

    def _columns(self, job: Job, sha256: str) -> dict[str, Any]:
        """Return the columns known without reading the file."""
        rule = self.study.rule_of(job.file)
        signature = job.signature._asdict()
        measured = {"measured_at": job.signature.modified}
        return {"file": printable(job.file), "run": "", "rig": rule.rig_name, "sha256": sha256, **signature, **measured}

    def _fit(self, law: Law, runs: Sequence[_Run], done: Done) -> None:
        """Fit one law to runs and append their rows."""
        started = time.perf_counter()
        outcomes = self._fitted(law, runs)
        seconds = (time.perf_counter() - started) / max(len(runs), 1)
        for run, outcome in zip(runs, outcomes, strict=True):
            row: dict[str, Any] = self._row(law, run, outcome.status, outcome.sentence)
            row |= {**outcome.columns, "seconds_fit": seconds}
            done.rows.append(row)
            if self.study.residuals and outcome.residuals is not None:
                done.residuals[row["key"]] = netcdf(row, outcome.residuals)

    def _fitted(self, law: Law, runs: Sequence[_Run]) -> "list[_Outcome]":
        """Fit runs together; after an unexpected error, fit each run alone."""
        try:
            return self._fitted_together(law, runs)
        except Exception as error:
            if len(runs) == 1:
                return [_Outcome(*_outcome(error))]
            return [outcome for run in runs for outcome in self._fitted(law, [run])]

    def _fitted_together(self, law: Law, runs: Sequence[_Run]) -> "list[_Outcome]":
        outcomes = [_Outcome(*_outcome(run.record)) if isinstance(run.record, Exception) else None for run in runs]
        requests = {}
        for i, run in enumerate(runs):
            if outcomes[i] is None:
                rule = self.study.rule_of(run.job.file)
                try:
                    load = self.study.load_of(run.job.facts, rule)
                    requests[i] = self.study.request(law, rule, load)
                except (DataError, UsageError) as error:
                    outcomes[i] = _Outcome(*_outcome(error))
        rows = fit_rows([runs[i].record for i in requests], list(requests.values()))
        groups: dict[Any, list[int]] = {}
        for i, row in zip(requests, rows, strict=True):
            if row.problem is None:
                outcomes[i] = _Outcome("rejected", row.status.removeprefix(_REJECTED))
            else:
                groups.setdefault((row.problem.names, tuple(row.problem.inputs)), []).append(i)
        by_number = dict(zip(requests, rows, strict=True))
        for numbers in groups.values():
            calibrated = [self.study.calibrated_by(self.study.rule_of(runs[i].job.file)) for i in numbers]
            fitted = _outcomes([by_number[i] for i in numbers], calibrated, self.study.residuals)
            for i, known, outcome in zip(numbers, calibrated, fitted, strict=True):
                load = float(by_number[i].problem.residual.oscillator.normal_force)  # pyright: ignore[reportOptionalMemberAccess]
                outcome.columns["load"] = load if known else None
                outcomes[i] = outcome
        return [outcome for outcome in outcomes if outcome is not None]

    def _row(self, law: Law, run: _Run, status: str, sentence: str) -> dict[str, Any]:
        settings = settings_of(self.study, law, self.study.rule_of(run.job.file), run.job.facts)
        return {
            **run.columns,
            "friction": law.name,
            "status": status,
            "outcome": sentence,
            "settings": settings,
            "key": _key(run, settings),
            "finished_at": iso_time(time.time_ns()),
            **versions(),
            "host": platform.node(),
            "worker": str(os.getpid()),
        }


def _key(run: _Run, settings: str) -> str:
    """Return the key of a run.

    It is a hash of the bytes of the file, the name of the run and the settings.
    """
    # An unreadable file is identified by its path.
    parts = (SCHEMA, run.columns["sha256"] or run.columns["file"], settings, run.columns["run"])
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@dataclasses.dataclass
class _Outcome:
    """Outcome of a run: status, sentence, and, if fitted, columns and residuals."""

    status: str
    sentence: str
    columns: dict[str, Any] = dataclasses.field(default_factory=dict)
    residuals: Any = None


def _outcome(error: Exception) -> tuple[str, str]:
    """Return status and sentence of a run that was not fitted."""
    if isinstance(error, DataError | UsageError):
        return "rejected", " ".join(str(error).partition("\n")[0].split())
    if isinstance(error, OSError):
        return "rejected", f"The file cannot be read: {error.strerror or error}."
    if isinstance(error, WorkerDied):
        return "failed", str(error)
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "fricjax" in Path(frame.filename).parts]
    place = next(
        (f" in {'/'.join(Path(f.filename).parts[-3:])}, line {f.lineno}" for f in reversed(ours or frames)), ""
    )
    words = " ".join(str(error).split())[:300]
    return "failed", f"Unexpected {type(error).__name__}{place}: {words or 'no further words'}"


def _check_file(study: Study, job: Job) -> None:
    """Reject files that may not be a run of the study.

    Raises:
        DataError: a file that is too large, or a link to a file outside the folder.
    """
    name = printable(Path(job.file).name)
    if job.signature.bytes > LARGEST_FILE:
        size, most = gigabytes(job.signature.bytes), gigabytes(LARGEST_FILE)
        raise DataError(f"{name} has {size}, and at most {most} are expected of a run.")
    # An error message may quote the first line of a file, and the table may be published.
    inside = Path(os.path.realpath(study.root / job.file)).is_relative_to(os.path.realpath(study.root))
    if study.files is None and not inside:
        raise DataError(
            f"{name} is a link that leads out of the folder of the runs. Put the file itself there, or name all files."
        )


def _records(path: Path, rule: Rule) -> list[Record]:
    """Read the runs of a file with the options of a rule."""
    with warnings.catch_warnings():
        # The record and its row already contain the assumptions of the reader.
        warnings.simplefilter("ignore")
        records = read(path, **{"run": "all", **rule.reading})
    return records if isinstance(records, list) else [records]


@one_at_a_time()
def _facts_of(record: Record | Exception) -> dict[str, Any]:
    """Return the columns known of a run before its fit."""
    if isinstance(record, Exception):
        return {}
    facts: dict[str, Any] = {
        "run": str(record.meta.get("run") or ""),
        "quantity": record.quantity,
        "samples": len(record),
        "rate": record.rate,
        "duration": record.duration,
    }
    if record.meta.get("measured_at"):
        facts["measured_at"] = str(record.meta["measured_at"])
    t, x, known = record.t - record.t[0], record.x, record.mask
    middle = float(np.median(x[known])) if known.any() else 0.0
    # The fit rejects a record that is no decay, with its reason.
    try:
        segmentation = record.segmentation
        middle = equilibrium(segmentation)
        facts["reversal_t"] = segmentation.turning_times - record.t[0]
        facts["reversal_x"] = segmentation.turning_points - middle
        if segmentation.turning_points.size:
            facts["amplitude"] = abs(float(segmentation.turning_points[0]) - middle)
    except DataError:
        pass
    chosen = few(t.size)
    facts |= {"sketch_t": t[chosen], "sketch_x": np.where(known, x - middle, np.nan)[chosen]}
    return facts


def _outcomes(rows: Sequence[Row], calibrated: Sequence[bool], with_residuals: bool) -> list[_Outcome]:
    """Return the outcomes of fitted runs.

    Coefficients of an uncalibrated machine are omitted.
    """
    batch = collected(rows, ("",) * len(rows))
    solved: Any = [(row.problem, row.weighted.solution) for row in rows if row.weighted is not None]
    pictures = sketches(solved)
    residuals = sketches(solved, None) if with_residuals else [None] * len(rows)
    numbers = _numbers(batch)
    # Parameters that also depend on mass and load, not on the record alone.
    coefficients = [name for name in batch.names if not of_run(name)]
    meaningless = [f"{name}{ending}" for name in coefficients for ending in ("", "_std", "_combined_std")]
    outcomes = []
    for i, (picture, left) in enumerate(zip(pictures, residuals, strict=True)):
        shown = {"sketch_t": picture.t, "sketch_x": picture.x, "sketch_residual": picture.residual}
        status = "ok" if batch.status[i] == CONVERGED else "invalid"
        columns = {name: column[i] for name, column in numbers.items()} | shown
        columns |= {} if calibrated[i] else dict.fromkeys(meaningless)
        outcomes.append(_Outcome(status, batch.status[i], columns, left))
    return outcomes


def _numbers(batch: "BatchFit") -> dict[str, Sequence[Any]]:
    """Return the columns of a batch fit."""
    frame = batch.to_dataframe()
    columns = {name: frame[name].to_list() for name in frame if name not in ("source", "converged", "status")}
    counts = {name: getattr(batch, name).tolist() for name in ("half_cycles", "iterations", "passes")}
    return {**columns, "sigma": batch.sigma.tolist(), **counts, "engine": [batch.engine] * len(batch)}
