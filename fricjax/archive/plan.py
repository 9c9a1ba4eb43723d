"""Plan of a batch: files to fit, files already known, and chunks.

A file is identified by its size, modification time and inode, so thousands of known runs need not be read again. A file
that was moved, copied or touched is recognised by the hash of its bytes.
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
from ..data.files import check_regular, printable
from ..data.read import SUFFIXES
from ..errors import DataError, UsageError
from .study import Law, Rule, Study, matches

# Largest total size of the files of a chunk in bytes, since their data and results must fit into memory.
_LARGEST = 1 << 25
_BLOCK = 1 << 20
LARGEST_FILE = 1 << 36
"""Largest file of a run in bytes; a sparse file that claims more would take hours to read."""


class Signature(NamedTuple):
    """File identity: size in bytes, modification time (ISO, UTC), inode."""

    bytes: int
    modified: str
    inode: int


@dataclasses.dataclass(frozen=True)
class Job:
    """File to fit.

    Attributes:
        file: path relative to the folder of the study.
        signature: signature at the time of planning.
        facts: facts from its path.
        laws: indices of the laws to fit.
    """

    file: str
    signature: Signature
    facts: Mapping[str, str]
    laws: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Chunk:
    """Files that one worker reads and fits together.

    Their runs are likely to share compiled programs.
    """

    jobs: tuple[Job, ...]

    def __len__(self) -> int:
        return len(self.jobs)


@dataclasses.dataclass(frozen=True)
class Known:
    """File with complete results in the store.

    Attributes:
        file, signature, facts: as of a `Job`.
        sha256: hash of its bytes.
        moved: whether its records have another path or other times, so that they must be updated.
    """

    file: str
    signature: Signature
    facts: Mapping[str, str]
    sha256: str
    moved: bool


@dataclasses.dataclass(frozen=True)
class Plan:
    """Plan of the files to fit, with the files already known.

    Attributes:
        chunks: files to fit.
        known: files with complete results.
        files: all files of the study, including those of other shards.
        changed: files to fit again because their bytes have changed.
        links: links to folders, which are not followed.
    """

    chunks: tuple[Chunk, ...]
    known: tuple[Known, ...]
    files: tuple[str, ...]
    changed: tuple[str, ...]
    links: tuple[str, ...] = ()

    @property
    def jobs(self) -> list[Job]:
        """Files to fit."""
        return [job for chunk in self.chunks for job in chunk.jobs]


def plan(
    study: Study,
    records: Sequence[Mapping[str, Any]] = (),
    *,
    shard: tuple[int, int] = (1, 1),
    retry: bool = False,
    store: Path | None = None,
) -> Plan:
    """Plan the work for a study.

    Args:
        study: the study.
        records: rows of the store with `file`, `status`, `settings`, `sha256`, `bytes`, `modified` and `inode`.
        shard: part of the files to process, such as (2, 3) for the second of three.
        retry: fit rejected and failed runs again.
        store: the folder of the store, which is excluded from the search for runs.

    Raises:
        UsageError: no files, or a file outside the folder of the study.
    """
    links: list[str] = []
    files = study.files if study.files is not None else tuple(_files_below(study, store, links))
    if not files and study.include:
        raise UsageError(f"No file in {study.root} matches {' or '.join(study.include)}. Check the pattern.")
    if not files:
        raise UsageError(
            f"{study.root} holds no file of a known format. Give another folder, or a pattern with include=."
        )
    history = _History(records, retry)
    jobs, known, changed = [], [], []
    for file in files:
        if shard[1] > 1 and zlib.crc32(os.fsencode(file)) % shard[1] != shard[0] - 1:
            continue
        job, done = _looked_up(study, file, history)
        if done is not None:
            known.append(done)
        else:
            jobs.append(job)
            name = printable(file)
            if name in history.files and job.signature not in history.files[name]:
                changed.append(name)
    return Plan(tuple(_chunks(study, jobs)), tuple(known), tuple(files), tuple(changed), tuple(links))


class _History:
    """Index of the records of a store."""

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
    """Return the job of a file; if complete, also its known results."""
    path = study.root / file
    facts = study.facts_of(file)
    signature = signature_of(path)
    seen = history.files.get(printable(file), {}).get(signature, "")
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
    """Return the digest of the settings of a run.

    A run with an invalid load has a digest too.
    """
    try:
        load = study.load_of(facts, rule)
    except DataError:
        load = float("-inf")
    return _digest(_ById(study), _ById(law), _ById(rule), load)


class _ById:
    """Cache key by identity, for values that cannot be hashed."""

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
    """Return the signature of a file, an empty one if unreadable."""
    try:
        stat = os.stat(path)
    except (OSError, ValueError):
        return Signature(-1, "", 0)
    return Signature(stat.st_size, iso_time(stat.st_mtime_ns), stat.st_ino)


def iso_time(nanoseconds: int) -> str:
    """Format nanoseconds since 1970 as ISO text in UTC.

    Nanoseconds are kept, since they identify files.
    """
    seconds, rest = divmod(nanoseconds, 10**9)
    return f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(seconds))}.{rest:09d}Z"


def hash_of(path: Path) -> str:
    """Return the SHA-256 hash of a file, read in blocks.

    The hash is empty if the file is unreadable or too large for a run.
    """
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


def _files_below(study: Study, store: Path | None, links: list[str]) -> Iterator[str]:
    """Yield the runs below the folder of a study, sorted by name.

    Links to folders are appended to `links`.
    """
    if not study.root.is_dir():
        raise UsageError(f"There is no folder {study.root}. Give the folder that holds the runs, or their paths.")
    suffixes = {*SUFFIXES, *(suffix.lower() for suffix in plugins.suffixes())}
    inside = None if store is None else os.path.realpath(store)
    names = sorted(_walked(study.root, "", inside, links))
    for name in names:
        wanted = any(matches(name, each) for each in study.include) if study.include else _suffix(name) in suffixes
        if wanted and not any(matches(name, each) for each in study.exclude):
            yield name


def _walked(folder: Path | str, place: str, without: str | None, links: list[str]) -> Iterator[str]:
    """Yield POSIX paths of all files below a folder.

    Hidden files and the store are skipped. Links to folders are appended to `links`.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            # A link to a parent folder would cause infinite recursion.
            if entry.is_dir(follow_symlinks=False):
                if os.path.realpath(entry.path) != without:
                    yield from _walked(entry.path, f"{place}{entry.name}/", without, links)
            elif entry.is_symlink() and os.path.isdir(entry.path):
                links.append(printable(f"{place}{entry.name}"))
            else:
                yield f"{place}{entry.name}"


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1].lower()


def _chunks(study: Study, jobs: Sequence[Job]) -> Iterator[Chunk]:
    """Group files that are likely to share a shape.

    They have the same suffix, the same laws and similar sizes.
    """
    from ..fitting.chunks import blocks

    groups: dict[Any, list[Job]] = {}
    for job in jobs:
        groups.setdefault((_suffix(job.file), job.laws), []).append(job)
    # Laws integrated on a mesh are fitted run by run, so smaller chunks cost little and lose less if interrupted.
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
