"""Batch fit of a folder of runs into an archive.

Each chunk of files is written as soon as it is done.
"""

import contextlib
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError, first_of, nearest
from ..show.working import working
from .archive import Archive, open_archive
from .plan import Plan, plan
from .store import Store
from .study import DEFAULTS, Law, Rule, Study
from .study_file import read_study
from .table import STATUSES, of_rows

if TYPE_CHECKING:
    from .execute import Executor

type Runs = str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | Study
type Tell = Callable[[int, int, Mapping[str, int]], None]

FREE = ("mu", "damping", "stiffness")
"""Default free coefficients, which a decay on a spring determines."""


def batch(
    runs: Runs,
    out: str | os.PathLike[str],
    oscillator: Any = None,
    free: Sequence[str] = FREE,
    *,
    retry_failed: bool = False,
    shard: tuple[int, int] = (1, 1),
    execute: "Executor | None" = None,
    tell: Tell | None = None,
    **study: Any,
) -> Archive:
    """Fit all runs of a folder into a resumable store.

    A run that cannot be fitted never stops the others; its row gives the reason. Results in the store are reused as
    long as neither the bytes of the file nor the settings have changed.

    Args:
        runs: a folder, paths of files, a `study.toml` (see :mod:`fricjax.archive.study_file`), or a `Study`.
        out: the folder of the store, created if missing.
        oscillator: the oscillator with its friction law, or several; each law gets a row. With a `rig`, only the
            friction law is used.
        free: names of the coefficients to fit.
        retry_failed: fit rejected and failed runs again.
        shard: part of the files to process, such as (2, 3) for the second of three; several shards may share a store.
        execute: executor of chunks; None uses this process.
        tell: function called after each chunk with the number of finished files, their total number, and the number of
            rows with each status.
        **study: further fields of a study: `rig` (or the path of its file), `reading` (options of `fricjax.read` for
            all files), `include` and `exclude` (patterns of files, such as ``["lab_b/**/*.csv"]``), `facts` (path
            templates, such as ``["load_{load}N/run_{number}.csv"]``; each fact becomes a column, and a load the normal
            force [N]), `residuals` (also write the residuals of each run as netCDF). From `fit_batch`: `nuisance`,
            `engine`, `start`, `bounds`, `priors`, `tie`, `guess`, `loss` and `noise`.

    Returns:
        The archive.

    Raises:
        UsageError: no runs, settings that fit no run, or a store of another study.
        OSError: the store cannot be written, for example on a full disk; finished chunks are kept.

    Examples:
        >>> import fricjax as fj
        >>> from pathlib import Path
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> folder = Path("runs"); folder.mkdir()
        >>> for seed in (0, 1):
        ...     run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed)
        ...     _ = fj.write(run, folder / f"run_{seed}.csv")
        >>> archive = fj.batch(folder, "results", machine, facts=["run_{number}.csv"])
        >>> archive.to_dataframe()[["file", "status", "number"]].values.tolist()
        [['run_0.csv', 'ok', 0.0], ['run_1.csv', 'ok', 1.0]]
    """
    if isinstance(runs, str | os.PathLike) and os.fspath(runs).endswith(".toml"):
        name, asked = os.fspath(runs), read_study(Path(runs))
    elif isinstance(runs, Study):
        name, asked = "The study", runs
    else:
        name, asked = "", study_of(runs, oscillator, free, **study)
    if name and (oscillator is not None or study):
        raise UsageError(f"{name} already defines the model and its settings: leave the other arguments out.")
    return process(asked, out, retry=retry_failed, shard=shard, execute=execute, tell=tell)


run = batch
"""Alias of `batch` as ``fricjax.archive.run``."""


def study_of(
    runs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    oscillator: Any = None,
    free: Sequence[str] = FREE,
    *,
    rig: Any = None,
    reading: Mapping[str, Any] | None = None,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    facts: Sequence[str] = (),
    residuals: bool = False,
    **settings: Any,
) -> Study:
    """Create the study of runs with one reader configuration and one rig.

    Arguments are as in `batch`.

    Raises:
        UsageError: no runs, no oscillator, or an unknown setting.
    """
    for name in settings:
        if name not in DEFAULTS:
            known = ("rig", "reading", "include", "exclude", "facts", "residuals", *DEFAULTS)
            raise UsageError(f"batch has no setting {name!r}.{nearest(name, known)} Known are {', '.join(known)}.")
    name = ""
    if isinstance(rig, str | os.PathLike):
        from ..rig import Rig

        rig, name = Rig.from_toml(Path(rig)), Path(rig).name
    root, files = place_of(runs)
    return Study(
        root,
        _laws(oscillator, rig, free),
        files,
        include=tuple(include),
        exclude=tuple(exclude),
        rules=(Rule("**", reading or {}, rig, name),),
        facts=tuple(facts),
        settings=settings,
        residuals=residuals,
    )


def process(
    study: Study,
    out: str | os.PathLike[str],
    *,
    retry: bool = False,
    shard: tuple[int, int] = (1, 1),
    execute: "Executor | None" = None,
    tell: Tell | None = None,
) -> Archive:
    """Process the files of a study that its store does not contain.

    Arguments are as in `batch`.

    Raises:
        UsageError: as `batch`.
        OSError: the store cannot be written.
        KeyboardInterrupt: after Ctrl-C, once running chunks are written.
    """
    from ..oscillator import ready

    ready()
    store = Store(out)
    _check(study)
    with store.locked(shard):
        store.begin(study)
        records = store.records()
        planned = plan(study, records, shard=shard, retry=retry, store=store.path)
        if planned.links:
            warnings.warn(
                f"Links to folders are not followed: {first_of(planned.links)}. Give the folders themselves to fit "
                "their runs.",
                stacklevel=2,
            )
        try:
            _relabel(study, store, planned)
            _do(study, store, planned, execute, tell)
        except BaseException:
            # Also on a full disk: then only the table cannot be written, and no part is lost.
            with contextlib.suppress(OSError):
                store.write_table(study.root)
            raise
        try:
            store.write_table(study.root)
        except OSError as error:
            words = f"{error.strerror}. All files are done and their rows kept; start again to write the table"
            raise OSError(error.errno, words, error.filename) from error
    return open_archive(out)


def plan_of(study: Study, out: str | os.PathLike[str], *, retry: bool = False, shard: tuple[int, int] = (1, 1)) -> Plan:
    """Return the plan of `process` without changing the store."""
    store = Store(out)
    _check(study)
    if store.exists:
        store.check(study)
    return plan(study, store.records(), shard=shard, retry=retry, store=store.path)


def _do(study: Study, store: Store, planned: Plan, execute: "Executor | None", tell: Tell | None) -> None:
    """Fit the planned files; write each chunk before reporting the next."""
    from .execute import in_this_process
    from .work import Work

    execute = in_this_process if execute is None else execute
    total, ended, counts = sum(map(len, planned.chunks)), 0, dict.fromkeys(map(str, STATUSES), 0)
    results = execute(planned.chunks, Work(study))
    with working("Fitting files", total) as task, contextlib.closing(results):
        for chunk, done in results:
            try:
                store.write_part(of_rows(done.rows), done.residuals)
            except OSError as error:
                words = f"{error.strerror}. {ended} of {total} files are done and kept; start again for the others"
                raise OSError(error.errno, words, error.filename) from error
            ended += len(chunk)
            for row in done.rows:
                counts[row["status"]] += 1
            task.advance(len(chunk))
            task.detail = ", ".join(f"{count} {name}" for name, count in counts.items() if name != "ok" and count)
            if tell is not None:
                tell(ended, total, counts)


def _relabel(study: Study, store: Store, planned: Plan) -> None:
    """Update the records of files that were moved, copied or touched."""
    from .plan import settings_of

    moved = []
    for known in planned.known:
        if known.moved:
            rule = study.rule_of(known.file)
            columns = {"file": known.file, "rig": rule.rig_name, **known.signature._asdict()}
            moved += [(known.sha256, settings_of(study, law, rule, known.facts), columns) for law in study.laws]
    if moved:
        store.relabel(moved)


def _check(study: Study) -> None:
    """Reject settings that fit no run.

    Raises:
        UsageError: as in `fricjax.fit`.
    """
    from ..fitting.parameters import shared_leaves
    from ..oscillator.oscillator import leaves_of

    for law in study.laws:
        for rule in study.rules or (Rule(),):
            request = study.request(law, rule, float("nan"))
            shared_leaves(request, leaves_of(request.oscillator))
    for template in study.facts:
        study.facts_of(template)


def place_of(runs: Any) -> tuple[Path, tuple[str, ...] | None]:
    """Return the common folder of runs and their relative paths.

    The paths are None for all runs of a folder.
    """
    if isinstance(runs, str | os.PathLike):
        path = Path(runs)
        return (path.parent, (path.name,)) if path.is_file() else (path, None)
    paths = [os.path.abspath(path) for path in runs]
    if not paths:
        raise UsageError("There is no run to fit: the list is empty.")
    folders = [os.path.dirname(path) for path in paths]
    root = os.path.commonpath(folders)
    names = tuple(dict.fromkeys(Path(os.path.relpath(path, root)).as_posix() for path in paths))
    return Path(root), names


def _laws(oscillator: Any, rig: Any, free: Sequence[str]) -> tuple[Law, ...]:
    """Return the laws of the oscillators, named as on the command line."""
    if oscillator is None:
        if rig is None:
            raise UsageError("batch needs a machine: give an oscillator, or a rig= for a Coulomb law on it.")
        from ..friction import Coulomb

        oscillator = rig.oscillator(Coulomb(0.01))
    several = oscillator if isinstance(oscillator, list | tuple) else [oscillator]
    laws = tuple(Law(name_of(each), each, tuple(free)) for each in several)
    if len({law.name for law in laws}) < len(laws):
        raise UsageError("Two of the oscillators have the same friction law; a run has one row for each law.")
    return laws


def name_of(oscillator: Any) -> str:
    """Return the command-line name of the friction law, such as "coulomb+quadraticdrag"."""
    from ..friction.base import law_name

    return law_name(oscillator.friction).replace(" ", "").lower()
