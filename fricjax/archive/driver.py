"""Batch fit of a folder of runs into an archive.

Each chunk of files is written as soon as it is done.
"""

import contextlib
import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import UsageError, first_of, nearest
from ..fitting.parameters import shared_leaves
from ..oscillator import ready
from ..oscillator.oscillator import leaves_of
from ..show.working import working
from .archive import Archive, open_archive
from .execute import Executor, in_this_process
from .plan import Plan, plan
from .store import Store
from .study import DEFAULTS, Law, Rule, Study, name_of
from .study_file import read_study
from .table import STATUSES, of_rows
from .work import Work

type Tell = Callable[[int, int, Mapping[str, int]], None]


def batch(
    runs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | Study,
    out: str | os.PathLike[str],
    oscillator: Any = None,
    free: Sequence[str] = ("mu", "damping", "stiffness"),
    *,
    retry_failed: bool = False,
    shard: tuple[int, int] = (1, 1),
    execute: Executor | None = None,
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
        name, asked = "", _study_of(runs, oscillator, free, **study)
    if name and (oscillator is not None or study):
        raise UsageError(f"{name} already defines the model and its settings: leave the other arguments out.")
    ready()
    _check(asked)
    store = Store(out)
    with store.locked(shard):
        store.begin(asked)
        planned = plan(asked, store.records(), shard=shard, retry=retry_failed, store=store.path)
        if planned.links:
            words = f"Links to folders are not followed: {first_of(planned.links)}."
            warnings.warn(f"{words} Give the folders themselves to fit their runs.", stacklevel=2)
        try:
            if planned.moved:
                store.relabel(planned.moved)
            _fit(asked, store, planned, in_this_process if execute is None else execute, tell)
        except BaseException:
            # Also on a full disk: then only the table cannot be written, and no part is lost.
            with contextlib.suppress(OSError):
                store.write_table(asked.root)
            raise
        try:
            store.write_table(asked.root)
        except OSError as error:
            words = f"{error.strerror}. All files are done and their rows kept; start again to write the table"
            raise OSError(error.errno, words, error.filename) from error
    return open_archive(out)


run = batch
"""Alias of `batch` as ``fricjax.archive.run``."""


def plan_of(study: Study, out: str | os.PathLike[str], *, retry: bool = False, shard: tuple[int, int] = (1, 1)) -> Plan:
    """Return the plan of `batch` without changing the store."""
    store = Store(out)
    _check(study)
    store.check(study)
    return plan(study, store.records(), shard=shard, retry=retry, store=store.path)


def _check(study: Study) -> None:
    """Reject settings that fit no run, as in `fricjax.fit`."""
    for law in study.laws:
        for rule in study.rules or (Rule(),):
            request = study.request(law, rule, float("nan"))
            shared_leaves(request, leaves_of(request.oscillator))
    for template in study.facts:
        study.facts_of(template)


def _fit(study: Study, store: Store, planned: Plan, execute: Executor, tell: Tell | None) -> None:
    """Fit the planned files; write each chunk before reporting the next."""
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


def _study_of(
    runs: Any,
    oscillator: Any,
    free: Sequence[str],
    rig: Any = None,
    reading: Mapping[str, Any] | None = None,
    include: Sequence[str] = (),
    exclude: Sequence[str] = (),
    facts: Sequence[str] = (),
    residuals: bool = False,
    **settings: Any,
) -> Study:
    """Create the study of runs with one reader configuration and one rig."""
    for name in settings:
        if name not in DEFAULTS:
            known = ("rig", "reading", "include", "exclude", "facts", "residuals", *DEFAULTS)
            raise UsageError(f"batch has no setting {name!r}.{nearest(name, known)} Known are {', '.join(known)}.")
    rig_name = ""
    if isinstance(rig, str | os.PathLike):
        from ..rig import Rig

        rig, rig_name = Rig.from_toml(Path(rig)), Path(rig).name
    if oscillator is None:
        if rig is None:
            raise UsageError("batch needs a machine: give an oscillator, or a rig= for a Coulomb law on it.")
        from ..friction import Coulomb

        oscillator = rig.oscillator(Coulomb(0.01))
    several = oscillator if isinstance(oscillator, list | tuple) else [oscillator]
    laws = tuple(Law(name_of(each), each, tuple(free)) for each in several)
    if len({law.name for law in laws}) < len(laws):
        raise UsageError("Two of the oscillators have the same friction law; a run has one row for each law.")
    root, files = place_of(runs)
    rules = (Rule("**", reading or {}, rig, rig_name),)
    patterns = tuple(include), tuple(exclude)
    return Study(root, laws, files, *patterns, rules, tuple(facts), settings, residuals=residuals)


def place_of(runs: Any) -> tuple[Path, tuple[str, ...] | None]:
    """Return the folder of runs and their names, None for all."""
    if isinstance(runs, str | os.PathLike):
        path = Path(runs)
        return (path.parent, (path.name,)) if path.is_file() else (path, None)
    paths = [os.path.abspath(path) for path in runs]
    if not paths:
        raise UsageError("There is no run to fit: the list is empty.")
    root = os.path.commonpath([os.path.dirname(path) for path in paths])
    names = tuple(dict.fromkeys(Path(os.path.relpath(path, root)).as_posix() for path in paths))
    return Path(root), names
