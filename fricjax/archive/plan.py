"""What is to be done: the files of a study, what the store knows of them already, and chunks of the rest.

A file is known by its size, its time of modification and its number on the disk, so that a store of thousands of runs
goes on without reading them. One that looks like another that was fitted, for it was moved, copied or touched, is
known again by the hash of its bytes.
"""

import dataclasses
import functools
import hashlib
import os
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..data import plugins
from ..data.files import check_regular
from ..data.read import READERS
from ..errors import DataError, UsageError
from .study import Law, Rule, Study, matches

# Bytes of the files of a chunk: what is read of them, and computed of it, must fit into memory.
_LARGEST = 1 << 25
_BLOCK = 1 << 20
LARGEST_FILE = 1 << 36
"""Bytes of the largest file of a run; one that claims more, for it is full of holes, would be read for hours."""


class Signature(NamedTuple):
    """What tells that a file is as it was: size in bytes, time of modification (ISO, UTC), number on the disk."""

    bytes: int
    modified: str
    inode: int


@dataclasses.dataclass(frozen=True)
class Job:
    """A file that is to be fitted.

    Attributes:
        file: its path relative to the folder of the study.
        signature: what it looked like when the study was planned.
        facts: what its path says.
        laws: indices of the laws that are to be fitted to it.
    """

    file: str
    signature: Signature
    facts: Mapping[str, str]
    laws: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Chunk:
    """Files that one worker reads and fits together, for their runs are likely to share compiled computations."""

    jobs: tuple[Job, ...]

    def __len__(self) -> int:
        return len(self.jobs)


@dataclasses.dataclass(frozen=True)
class Known:
    """What the store has of a file that is as it was, or was moved: nothing is to be fitted.

    Attributes:
        file, signature, facts: as of a `Job`.
        sha256: hash of its bytes.
        moved: whether its records are of another path or of other times, so that they are to be written anew.
    """

    file: str
    signature: Signature
    facts: Mapping[str, str]
    sha256: str
    moved: bool


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is to be done, and what is done.

    Attributes:
        chunks: what is to be fitted.
        known: what was.
        files: all files of the study, also those of other shards.
        changed: files with records of other bytes, which are fitted anew.
    """

    chunks: tuple[Chunk, ...]
    known: tuple[Known, ...]
    files: tuple[str, ...]
    changed: tuple[str, ...]

    @property
    def jobs(self) -> list[Job]:
        """The files that are to be fitted."""
        return [job for chunk in self.chunks for job in chunk.jobs]


def plan(
    study: Study,
    records: Sequence[Mapping[str, Any]] = (),
    *,
    shard: tuple[int, int] = (1, 1),
    retry: bool = False,
    store: Path | None = None,
) -> Plan:
    """What is to be done for a study.

    Args:
        study: the study.
        records: what the store has: `file`, `status`, `settings`, `sha256`, `bytes`, `modified` and `inode` of each
            row.
        shard: the part of the files that is asked for, as (2, 3) for the second of three.
        retry: fit again what was rejected or failed.
        store: the folder of the store, none of whose files is a run.

    Raises:
        UsageError: no file, or one that is not below the folder of the study.
    """
    files = study.files if study.files is not None else tuple(_files_below(study, store))
    if not files and study.include:
        raise UsageError(f"No file in {study.root} matches {' or '.join(study.include)}. Check the pattern.")
    if not files:
        raise UsageError(
            f"{study.root} holds no file of a known format. Give another folder, or a pattern with include=."
        )
    history = _History(records, retry)
    jobs, known, changed = [], [], []
    for file in files:
        if shard[1] > 1 and zlib.crc32(file.encode()) % shard[1] != shard[0] - 1:
            continue
        job, done = _looked_up(study, file, history)
        if done is not None:
            known.append(done)
        else:
            jobs.append(job)
            if file in history.files and job.signature not in history.files[file]:
                changed.append(file)
    return Plan(tuple(_chunks(study, jobs)), tuple(known), tuple(files), tuple(changed))


class _History:
    """What the records of a store say, in the ways in which a plan asks for it."""

    def __init__(self, records: Iterable[Mapping[str, Any]], retry: bool) -> None:
        self.files: dict[str, dict[Signature, str]] = {}
        self.sizes: set[int] = set()
        self.done: set[tuple[str, str]] = set()
        again: set[tuple[str, str]] = set()
        for row in records:
            signature = Signature(row["bytes"], row["modified"], row["inode"])
            self.files.setdefault(row["file"], {})[signature] = row["sha256"]
            self.sizes.add(row["bytes"])
            self.done.add((row["sha256"], row["settings"]))
            if retry and row["status"] in ("rejected", "failed"):
                again.add((row["sha256"], row["settings"]))
        self.done -= again


def _looked_up(study: Study, file: str, history: _History) -> tuple[Job, Known | None]:
    """The job of a file, and what is known of it where nothing is to be done."""
    path = study.root / file
    facts = study.facts_of(file)
    signature = signature_of(path)
    seen = history.files.get(file, {}).get(signature, "")
    sha256 = seen
    if not seen and signature.bytes in history.sizes:
        sha256 = hash_of(path)
    wanted = range(len(study.laws))
    if sha256:
        rule = study.rule_of(file)
        digests = [settings_of(study, law, rule, facts) for law in study.laws]
        wanted = [i for i, digest in enumerate(digests) if (sha256, digest) not in history.done]
    job = Job(file, signature, facts, tuple(wanted))
    return job, None if wanted else Known(file, signature, facts, sha256, moved=not seen)


def settings_of(study: Study, law: Law, rule: Rule, facts: Mapping[str, str]) -> str:
    """The digest of what a run is fitted with; one that cannot be, for its load is none, has one too."""
    try:
        load = study.load_of(facts, rule)
    except DataError:
        load = float("-inf")
    return _digest(_ById(study), _ById(law), _ById(rule), load)


class _ById:
    """Something that is looked up by what it is and not by what is in it, which may have no hash."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ById) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)


@functools.lru_cache(maxsize=4096)
def _digest(study: _ById, law: _ById, rule: _ById, load: float) -> str:
    return study.value.digest(law.value, rule.value, load)


def signature_of(path: Path) -> Signature:
    """What a file looks like from outside; one that cannot be looked at looks like nothing."""
    try:
        stat = os.stat(path)
    except (OSError, ValueError):
        return Signature(-1, "", 0)
    return Signature(stat.st_size, iso_time(stat.st_mtime_ns), stat.st_ino)


def iso_time(nanoseconds: int) -> str:
    """A time since 1970 as ISO text in UTC, to the nanosecond, for files are distinguished by it."""
    seconds, rest = divmod(nanoseconds, 10**9)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(seconds))}.{rest:09d}Z"


def hash_of(path: Path) -> str:
    """SHA-256 of the bytes of a file, read in blocks; empty where it cannot be read or is too large for a run."""
    digest = hashlib.sha256()
    try:
        check_regular(path)
        if path.stat().st_size > LARGEST_FILE:
            return ""
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            while block := file.read(_BLOCK):
                digest.update(block)
    except (OSError, DataError):
        return ""
    return digest.hexdigest()


def _files_below(study: Study, store: Path | None) -> Iterator[str]:
    """The files below the folder of a study that are runs, in the order of their names."""
    if not study.root.is_dir():
        raise UsageError(f"There is no folder {study.root}. Give the folder that holds the runs, or their paths.")
    suffixes = {*READERS, *(suffix.lower() for suffix in plugins.suffixes())}
    inside = None if store is None else os.path.realpath(store)
    names = sorted(_walked(study.root, "", inside))
    for name in names:
        wanted = any(matches(name, each) for each in study.include) if study.include else _suffix(name) in suffixes
        if wanted and not any(matches(name, each) for each in study.exclude):
            yield name


def _walked(folder: Path | str, place: str, without: str | None) -> Iterator[str]:
    """Paths of all files below a folder, of slashes; hidden ones and those of the store are left out."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            # A link to a folder further up would be walked for ever.
            if entry.is_dir(follow_symlinks=False):
                if os.path.realpath(entry.path) != without:
                    yield from _walked(entry.path, f"{place}{entry.name}/", without)
            elif not (entry.is_symlink() and os.path.isdir(entry.path)):
                yield f"{place}{entry.name}"


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1].lower()


def _chunks(study: Study, jobs: Sequence[Job]) -> Iterator[Chunk]:
    """Files that are likely to share a shape: of one ending, of like sizes, and asked for the same laws."""
    from ..fitting.chunks import blocks

    groups: dict[Any, list[Job]] = {}
    for job in jobs:
        groups.setdefault((_suffix(job.file), job.laws), []).append(job)
    # A law that is integrated on a mesh is fitted run by run; of its short chunks little is lost with one.
    parts = 1 if all(law.oscillator.friction.kind == "set-valued" for law in study.laws) else 8
    for group in groups.values():
        by_size = sorted(group, key=lambda job: job.signature.bytes)
        for block in blocks(len(group), parts):
            chunk: list[Job] = []
            for job in by_size[block.start : block.stop]:
                if chunk and sum(j.signature.bytes for j in (*chunk, job)) > _LARGEST:
                    yield Chunk(tuple(chunk))
                    chunk = []
                chunk.append(job)
            yield Chunk(tuple(chunk))
