"""``fricjax batch``: fit every run of a folder into one table."""

import contextlib
import dataclasses
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NoReturn

from typer import Argument, Exit, Option

from ..errors import UsageError, first_of, nearest
from .failure import Interrupted
from .fit import Fitting, settings_of
from .options import Bench, Machine, Output, Reading
from .output import finish, prepare, tell, working
from .records import options_of

if TYPE_CHECKING:
    from ..archive import Archive, Study
    from ..archive.execute import Executor
    from ..archive.plan import Plan

_SHOWN = 20  # largest number of listed failures


@dataclasses.dataclass(frozen=True)
class Batch:
    """Options for the files, the laws and the store."""

    PANEL: ClassVar = "Archive"

    out: Annotated[Path | None, Option(help="Folder of the store (required). An existing store is continued.")] = None
    friction: Annotated[
        list[str] | None,
        Option(
            metavar="LAW",
            help="A law to fit; repeat it for several laws. Each run has one row per law. Default: coulomb.",
        ),
    ] = None
    include: Annotated[
        list[str] | None,
        Option(metavar="PATTERN", help='Use only files that match the pattern, such as "lab_b/**/*.csv".'),
    ] = None
    exclude: Annotated[list[str] | None, Option(metavar="PATTERN", help="Skip files that match the pattern.")] = None
    facts: Annotated[
        list[str] | None,
        Option(
            metavar="TEMPLATE",
            help="Template of facts in paths, such as load_{load}N/run_{number}.csv. A load applies to its run.",
        ),
    ] = None
    residuals: Annotated[bool, Option("--residuals", help="Write the residuals of each run as netCDF.")] = False
    retry_failed: Annotated[bool, Option("--retry-failed", help="Fit rejected and failed runs again.")] = False
    dry_run: Annotated[bool, Option("--dry-run", help="Show the plan and fit no run.")] = False
    shard: Annotated[
        str | None, Option(help="Part of the files to fit, such as 2/3. Several parts may share a store.")
    ] = None


@dataclasses.dataclass(frozen=True)
class Workers:
    """Options for the processes that fit; the default is this process."""

    PANEL: ClassVar = "Workers"

    workers: Annotated[int | None, Option(metavar="N", help="Number of processes on this machine.")] = None
    scheduler: Annotated[
        str | None, Option(metavar="ADDRESS", help="Address of a Dask scheduler, such as tcp://192.168.0.1:8786.")
    ] = None

    def executor(self) -> "Executor | None":
        """Return the executor of the chunks; None for this process.

        Raises:
            UsageError: both options are given, or the workers are not available.
        """
        if self.workers is not None and self.scheduler is not None:
            raise UsageError("--workers and --scheduler cannot both do the work; leave one out.")
        if self.workers is not None:
            from ..archive.execute import workers

            return workers(self.workers)
        if self.scheduler is not None:
            from ..archive.execute import scheduler

            return scheduler(self.scheduler)
        return None


def batch(
    runs: Annotated[list[Path], Argument(help="A folder of runs, files, or a study.toml.", show_default=False)],
    batch: Batch,
    workers: Workers,
    fitting: Fitting,
    bench: Bench,
    reading: Reading,
    output: Output,
) -> None:
    """Fit every run of a folder into one table.

    A broken file does not stop the batch: its row contains the reason. The exit code is 1 if some runs are not ok.
    """
    if batch.out is None:
        raise UsageError("batch needs a folder for its results: add --out results.")
    shard = shard_of(batch.shard)
    for path in runs:
        if not path.exists():
            siblings = [entry.name for entry in path.parent.iterdir()] if path.parent.is_dir() else []
            raise UsageError(f"There is no folder or file '{path}'.{nearest(path.name, siblings)} Check the path.")
    execute = workers.executor()
    study = _study(runs, batch, fitting, bench, reading, output)
    from ..archive import driver

    if batch.dry_run:
        planned = driver.plan_of(study, batch.out, retry=batch.retry_failed, shard=shard)
        finish(output, {"schema": "fricjax.plan/1", **_plan_data(planned)}, _plan_text(planned))
        return
    done = total = 0

    def count(ended: int, of_all: int, _: Any) -> None:
        nonlocal done, total
        done, total = ended, of_all

    try:
        with _two_interrupts(), working(output, f"Filling {batch.out}"):
            archive = driver.batch(
                study, batch.out, retry_failed=batch.retry_failed, shard=shard, execute=execute, tell=count
            )
    except KeyboardInterrupt as error:
        raise Interrupted(
            f"Interrupted. {done} of {total} files are done and kept in {batch.out}; the same command goes on with the "
            "others."
        ) from error
    finish(output, {"schema": "fricjax.status/1", **archive.to_dict()}, text_of(archive))
    if archive.counts["ok"] < len(archive):
        raise Exit(1)


@contextlib.contextmanager
def _two_interrupts() -> Iterator[None]:
    """Finish the files at work after one Ctrl-C; end at the second."""

    def announce(*_: Any) -> NoReturn:
        signal.signal(signal.SIGINT, before)
        tell(sys.stderr, "\nThe files at work are finished and kept first; Ctrl-C once more ends at once.")
        raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    # A command that a shell started with & ignores Ctrl-C, which is meant for other commands.
    if before is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, announce)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _study(runs: list[Path], batch: Batch, fitting: Fitting, bench: Bench, reading: Reading, output: Output) -> "Study":
    """Return the study for the options; check names before large imports."""
    from ..archive.study_file import read_study
    from ..fitting.settings import check_settings
    from ..machine.choose import choose

    if len(runs) == 1 and runs[0].suffix == ".toml":
        _check_alone(runs[0], batch, fitting, bench, reading)
        prepare(output)
        return read_study(runs[0])
    settings = settings_of(fitting)
    shared = {field.name: getattr(bench, field.name) for field in dataclasses.fields(bench)}
    choices = {}
    for law in batch.friction or ["coulomb"]:
        choice = choose(Machine(**shared, friction=law), fitting.free, tuple(settings["tie"]))
        check_settings(choice.model, choice.free, 1, {**settings, "sigma_mode": "absolute"})
        choices["+".join(part.name.lower() for part in choice.laws)] = choice
    prepare(output)
    from ..archive.driver import place_of
    from ..archive.study import Law, Rule, Study

    options = options_of(reading)
    first = next(iter(choices.values()))
    name = "" if bench.rig is None else bench.rig.name
    root, files = place_of(runs[0] if len(runs) == 1 else runs)
    return Study(
        root,
        tuple(Law(name, choice.oscillator, choice.free) for name, choice in choices.items()),
        files,
        include=tuple(batch.include or ()),
        exclude=tuple(batch.exclude or ()),
        rules=(Rule("**", options, first.rig, name),),
        facts=tuple(batch.facts or ()),
        settings={**settings, "engine": first.engine},
        calibrated=first.calibrated,
        residuals=batch.residuals,
    )


def _check_alone(file: Path, batch: Batch, *groups: Any) -> None:
    """Refuse options that a study file sets itself."""
    of_study = ("friction", "include", "exclude", "facts", "residuals")
    chosen = [name for name in of_study if getattr(batch, name)]
    for group in groups:
        fields = dataclasses.fields(group)
        chosen += [field.name for field in fields if getattr(group, field.name) != field.default]
    if chosen:
        option = f"--{chosen[0].replace('_', '-')}"
        raise UsageError(f"{file} defines the study: leave {option} out, or write it in the file.")


def shard_of(text: str | None) -> tuple[int, int]:
    """Parse a part of the files, such as 2/3.

    Raises:
        UsageError: no such text, or a part that does not exist.
    """
    if text is None:
        return 1, 1
    part, slash, parts = text.partition("/")
    if not (slash and part.strip().isdecimal() and parts.strip().isdecimal() and 1 <= int(part) <= int(parts)):
        raise UsageError(f"--shard '{text}' is no part; write for example --shard 2/3, for the second of three.")
    return int(part), int(parts)


def text_of(archive: "Archive") -> str:
    """Return a summary of the archive, with the first failures."""
    failures = archive.failures()
    shown = failures.head(_SHOWN)[["file", "run", "status", "outcome"]].to_numpy().tolist()
    lines = [f"{file}{f' [{run}]' if run else ''}: {status}: {outcome}" for file, run, status, outcome in shown]
    if len(failures) > _SHOWN:
        sql = "select file, outcome from runs where status <> 'ok'"
        lines.append(f'... and {len(failures) - _SHOWN} more: fricjax query "{sql}" {archive.path}')
    return "\n\n".join(filter(None, [archive.summary(), "\n".join(lines)]))


def _plan_data(planned: "Plan") -> dict[str, Any]:
    jobs = [job for chunk in planned.chunks for job in chunk]
    sizes = {
        "files": len(planned.files),
        "done": planned.done,
        "to_do": len(jobs),
        "changed": list(planned.changed),
        "links": list(planned.links),
    }
    return {**sizes, "bytes": sum(max(job.signature.bytes, 0) for job in jobs), "chunks": len(planned.chunks)}


def _plan_text(planned: "Plan") -> str:
    data = _plan_data(planned)
    lines = [
        f"files:    {data['files']}",
        f"done:     {data['done']}",
        f"to do:    {data['to_do']}, {data['bytes'] / 1e6:.3g} MB, in {data['chunks']} chunks",
    ]
    if planned.changed:
        lines.append(f"changed:  {first_of(planned.changed, 5)}")
    if planned.links:
        lines.append(f"skipped:  {first_of(planned.links, 5)} (links to folders)")
    return "\n".join(lines)
