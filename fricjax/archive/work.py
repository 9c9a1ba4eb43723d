"""Reading and fitting one chunk of files into table rows.

Runs of equal shape share a compiled program. No file raises an error here: each run gets a row that gives its outcome.
"""

import contextlib
import dataclasses
import hashlib
import os
import platform
import time
import traceback
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data import Record, Segmentation, read
from ..data.files import gigabytes, printable
from ..errors import DataError, UsageError
from ..fitting.batch import fit_rows
from ..fitting.diagnostics import describes
from ..fitting.names import of_run
from ..fitting.run_fit import RunFit, collected
from ..fitting.sketch import MOST, few
from ..fitting.window import equilibrium
from ..oscillator import one_at_a_time
from .plan import LARGEST_FILE, Chunk, Job, hash_of, iso_time, signature_of
from .study import SCHEMA, Law, Study, versions
from .table import netcdf


class Done(NamedTuple):
    """Rows of a chunk, and netCDF files of residuals by key."""

    rows: list[dict[str, Any]]
    residuals: dict[str, bytes]


class _Run(NamedTuple):
    """Run of a file, or its read error, with the known columns."""

    job: Job
    record: Record | Exception
    columns: Mapping[str, Any]


type _Outcome = tuple[dict[str, Any], Any]
"""Status, sentence and further columns of a run; a sketch of all residuals, or None."""


@dataclasses.dataclass(frozen=True)
class Work:
    """Work on the chunks of a study, picklable for workers."""

    study: Study

    def __call__(self, chunk: Chunk) -> Done:
        """Read and fit the files of a chunk."""
        runs = [run for job in chunk for run in self._read(job)]
        done = Done([], {})
        for number, law in enumerate(self.study.laws):
            of_law = [run for run in runs if number in run.job.laws]
            started = time.perf_counter()
            outcomes = self._fitted(law, of_law)
            seconds = (time.perf_counter() - started) / max(len(of_law), 1)
            for run, (columns, residuals) in zip(of_law, outcomes, strict=True):
                row = self._row(law, run.job, {**run.columns, **columns, "seconds_fit": seconds})
                done.rows.append(row)
                if residuals is not None:
                    done.residuals[row["key"]] = netcdf(row, residuals)
        return done

    def unfitted(self, chunk: Chunk, outcome: Mapping[str, str]) -> Done:
        """Return the same status and sentence for all files of a chunk."""
        pairs = [(job, self.study.laws[number]) for job in chunk for number in job.laws]
        return Done([self._row(law, job, {**self._columns(job, ""), **outcome}) for job, law in pairs], {})

    def _read(self, job: Job) -> list[_Run]:
        """Read the runs of a file."""
        started = time.perf_counter()
        path = self.study.root / job.file
        sha256 = hash_of(path)
        columns = self._columns(job, sha256)
        try:
            _check_file(self.study, job)
            with warnings.catch_warnings():
                # The record and its row already contain the assumptions of the reader.
                warnings.simplefilter("ignore")
                runs = read(path, **{"run": "all", **self.study.rule_of(job.file).reading})
            records: list[Record | Exception] = [*runs] if isinstance(runs, list) else [runs]
            if signature_of(path) != job.signature and hash_of(path) != sha256:
                raise DataError(f"{path.name} was written to while it was read. Start again when it is complete.")
        except Exception as error:
            records = [error]
        seconds = (time.perf_counter() - started) / len(records)
        return [_Run(job, record, {**columns, **_facts_of(record), "seconds_read": seconds}) for record in records]

    def _columns(self, job: Job, sha256: str) -> dict[str, Any]:
        """Return the columns known without reading the file."""
        known = {"file": printable(job.file), "run": "", "rig": self.study.rule_of(job.file).rig_name}
        return {**known, "sha256": sha256, **job.signature._asdict(), "measured_at": job.signature.modified}

    def _fitted(self, law: Law, runs: Sequence[_Run]) -> list[_Outcome]:
        """Fit runs together; after an unexpected error, fit each run alone."""
        try:
            return self._fitted_together(law, runs)
        except Exception as error:
            if len(runs) == 1:
                return [(outcome_of(error), None)]
            return [outcome for run in runs for outcome in self._fitted(law, [run])]

    def _fitted_together(self, law: Law, runs: Sequence[_Run]) -> list[_Outcome]:
        outcomes: dict[int, _Outcome] = {}
        requests = {}
        for i, run in enumerate(runs):
            try:
                if isinstance(run.record, Exception):
                    raise run.record
                rule, load = self.study.rule_of(run.job.file), self.study.load_of(run.job.file)
                requests[i] = self.study.request(law, rule, load)
            except Exception as error:
                outcomes[i] = (outcome_of(error), None)
        groups: dict[Any, dict[int, RunFit]] = {}
        segmentations = dict[int, Segmentation | None]()
        for i, row in zip(requests, fit_rows([runs[i].record for i in requests], list(requests.values())), strict=True):
            if row.rejected:
                outcomes[i] = {"status": "rejected", "outcome": row.status.removeprefix("rejected: ")}, None
            else:
                segmentations[i] = row.segmentation
                groups.setdefault((tuple(row.units), row.inputs), {})[i] = row
        for group in groups.values():
            rigs = [self.study.rule_of(runs[i].job.file).rig for i in group]
            calibrated = [self.study.calibrated or rig is not None for rig in rigs]
            fitted = _outcomes(list(group.values()), calibrated, self.study.residuals)
            outcomes |= dict(zip(group, fitted, strict=True))
        pictures = [_pictures_of(run.record, segmentations.get(i)) for i, run in enumerate(runs)]
        return [({**pictures[i], **columns}, residuals) for i, (columns, residuals) in sorted(outcomes.items())]

    def _row(self, law: Law, job: Job, columns: Mapping[str, Any]) -> dict[str, Any]:
        settings = self.study.settings_of(law, job.file)
        # An unreadable file is identified by its path.
        parts = (SCHEMA, columns["sha256"] or columns["file"], settings, columns["run"])
        return {
            **columns,
            "friction": law.name,
            "settings": settings,
            "key": hashlib.sha256("\0".join(parts).encode()).hexdigest(),
            "finished_at": iso_time(time.time_ns()),
            **versions(),
            "host": platform.node(),
            "worker": str(os.getpid()),
        }


def outcome_of(error: Exception) -> dict[str, str]:
    """Return status and sentence of a run that was not fitted."""
    if isinstance(error, DataError | UsageError):
        return {"status": "rejected", "outcome": " ".join(str(error).partition("\n")[0].split())}
    if isinstance(error, OSError):
        return {"status": "rejected", "outcome": f"The file cannot be read: {error.strerror or error}."}
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "fricjax" in Path(frame.filename).parts]
    places = [f" in {'/'.join(Path(f.filename).parts[-3:])}, line {f.lineno}" for f in ours or frames]
    words = " ".join(str(error).split())[:300] or "no further words"
    return {"status": "failed", "outcome": f"Unexpected {type(error).__name__}{''.join(places[-1:])}: {words}"}


def _check_file(study: Study, job: Job) -> None:
    """Reject a file that is too large or outside the folder."""
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


@one_at_a_time()
def _facts_of(record: Record | Exception) -> dict[str, Any]:
    """Return the columns known of a run before its fit."""
    if isinstance(record, Exception):
        return {}
    facts: dict[str, Any] = {name: getattr(record, name) for name in ("quantity", "rate", "duration")}
    facts |= {"run": str(record.meta.get("run") or ""), "samples": len(record)}
    if record.meta.get("measured_at"):
        facts["measured_at"] = str(record.meta["measured_at"])
    return facts


def _pictures_of(record: Record | Exception, segmentation: Segmentation | None) -> dict[str, Any]:
    """Return the columns with the motion of a record.

    Args:
        record: the record.
        segmentation: its reversals if they are known; None to look for them.
    """
    if isinstance(record, Exception):
        return {}
    t, x, known = record.t - record.t[0], record.x, record.mask
    middle, facts = float(np.median(x[known])) if known.any() else 0.0, dict[str, Any]()
    # The fit rejects a record that is no decay, with its reason.
    with contextlib.suppress(DataError):
        segmentation = segmentation or record.segmentation
        points, gain = segmentation.turning_points - equilibrium(segmentation), segmentation.gain
        # Only a displacement shows its reversals as turning points.
        if record.observation.kind == "displacement":
            middle = equilibrium(segmentation)
            facts["reversal_t"], facts["reversal_x"] = segmentation.turning_times - record.t[0], points
        if points.size:
            # In the unit of the reading, like the other columns.
            facts["amplitude"] = gain * abs(float(points[0]))
    chosen = few(t.size)
    return {**facts, "sketch_t": t[chosen], "sketch_x": np.where(known, x - middle, np.nan)[chosen]}


def _outcomes(rows: Sequence[RunFit], calibrated: Sequence[bool], with_residuals: bool) -> list[_Outcome]:
    """Return outcomes of fitted runs, without coefficients of uncalibrated machines."""
    batch = collected(rows, ("",) * len(rows))
    frame = batch.to_dataframe().drop(columns=["source", "converged", "described", "status"])
    for name in ("half_cycles", "iterations", "passes", "sigma"):
        frame[name] = getattr(batch, name).tolist()
    # Parameters that also depend on mass and load, not on the record alone.
    coefficients = [name for name in batch.names if not of_run(name)]
    meaningless = [f"{name}{ending}" for name in coefficients for ending in ("", "_std", "_combined_std")]
    outcomes = []
    for row, columns, known in zip(rows, frame.to_dict("records"), calibrated, strict=True):
        load, sketch, status = row.load, row.sketch, row.status
        assert sketch is not None
        columns |= {"load": load} if known else dict.fromkeys((*meaningless, "load"))
        columns |= {f"sketch_{name}": values for name, values in sketch(MOST)._asdict().items()}
        columns |= {"status": "ok" if describes(status) else "invalid", "outcome": status, "engine": row.engine}
        outcomes.append((columns, sketch(None) if with_residuals else None))
    return outcomes
