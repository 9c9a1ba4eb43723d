"""Plan of a batch: files to fit, files already known, and chunks.

A file is identified by its size, modification time and inode, so thousands of known runs need not be read again. A file
that was moved, copied or touched is recognised by the hash of its bytes.
"""

import hashlib
import itertools
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ..data import plugins
from ..data.files import check_regular, printable
from ..data.read import SUFFIXES
from ..errors import DataError, UsageError
from .study import Study, matches

# About the largest total size of the files of a chunk in bytes; their data and results must fit into memory.
_LARGEST = 1 << 25
LARGEST_FILE = 1 << 36
"""Largest file of a run in bytes; a sparse file that claims more would take hours to read."""


class Signature(NamedTuple):
    """File identity: size in bytes, modification time (ISO, UTC), inode."""

    bytes: int
    modified: str
    inode: int


class Job(NamedTuple):
    """File to fit, its signature when planned, and indices of its laws."""

    file: str
    signature: Signature
    laws: tuple[int, ...]


type Chunk = tuple[Job, ...]
"""Files that one worker reads and fits together. Their runs are likely to share compiled programs."""


class Plan(NamedTuple):
    """Plan of the files to fit.

    Attributes:
        chunks: files to fit.
        files: all files of the study, including those of other shards.
        done: number of files with complete results.
        moved: new columns of complete files that were moved or touched, by hash and settings.
        changed: files to fit again because their bytes have changed.
        links: links to folders, which are not followed.
    """

    chunks: tuple[Chunk, ...]
    files: tuple[str, ...]
    done: int
    moved: Mapping[tuple[str, str], list[dict[str, Any]]]
    changed: tuple[str, ...]
    links: tuple[str, ...]


def plan(
    study: Study,
    records: Sequence[Mapping[str, Any]] = (),
    *,
    shard: tuple[int, int] = (1, 1),
    retry: bool = False,
    store: Path | None = None,
) -> Plan:
    """Plan the work for a study.

    `records` are the rows of the store that is in the folder `store`, where no runs are searched. `shard` and `retry`
    are as of `batch`.
    """
    files, links = (list(study.files), []) if study.files is not None else _files_below(study, store)
    if not files:
        raise UsageError(
            f"No file in {study.root} matches {' or '.join(study.include)}. Check the pattern."
            if study.include
            else f"{study.root} holds no file of a known format. Give another folder, or a pattern with include=."
        )
    known: dict[str, dict[Signature, str]] = {}
    for row in records:
        known.setdefault(row["file"], {})[Signature(row["bytes"], row["modified"], row["inode"])] = row["sha256"]
    sizes = {row["bytes"] for row in records}
    again = {(row["sha256"], row["settings"]) for row in records if retry and row["status"] in ("rejected", "failed")}
    fitted = {(row["sha256"], row["settings"]) for row in records} - again
    jobs, done, changed = [], 0, []
    moved: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for file in files:
        if zlib.crc32(os.fsencode(file)) % shard[1] != shard[0] - 1:
            continue
        signature, name = signature_of(study.root / file), printable(file)
        sha256 = same = known.get(name, {}).get(signature, "")
        if not same and signature.bytes in sizes:
            sha256 = hash_of(study.root / file)
        settings = [sha256 and study.settings_of(law, file) for law in study.laws]
        laws = tuple(i for i, digest in enumerate(settings) if (sha256, digest) not in fitted or not sha256)
        done += not laws
        if laws:
            jobs.append(Job(file, signature, laws))
            if name in known and signature not in known[name]:
                changed.append(name)
        elif not same:
            columns = {"file": name, "rig": study.rule_of(file).rig_name, **signature._asdict()}
            for digest in settings:
                moved.setdefault((sha256, digest), []).append(columns)
    return Plan(tuple(_chunks(study, jobs)), tuple(files), done, moved, tuple(changed), tuple(links))


def signature_of(path: Path) -> Signature:
    """Return the signature of a file, an empty one if unreadable."""
    try:
        stat = os.stat(path)
    except (OSError, ValueError):
        return Signature(-1, "", 0)
    return Signature(stat.st_size, iso_time(stat.st_mtime_ns), stat.st_ino)


def iso_time(nanoseconds: int) -> str:
    """Format nanoseconds since 1970 as exact ISO text in UTC."""
    return f"{np.datetime64(nanoseconds, 'ns')}Z"


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file, empty if unreadable or too large."""
    try:
        check_regular(path)
        if path.stat().st_size > LARGEST_FILE:
            return ""
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, DataError):
        return ""


def _files_below(study: Study, store: Path | None) -> tuple[list[str], list[str]]:
    """Return the visible runs below a folder, and links to folders."""
    if not study.root.is_dir():
        raise UsageError(f"There is no folder {study.root}. Give the folder that holds the runs, or their paths.")

    def stop(error: OSError) -> NoReturn:
        raise error

    suffixes = {*SUFFIXES, *(suffix.lower() for suffix in plugins.suffixes())}
    files, links = [], []
    for folder, inner, names in os.walk(study.root, onerror=stop):
        place = Path(folder).relative_to(study.root)
        inner[:] = [name for name in inner if not name.startswith(".")]
        # A link to a parent folder would cause infinite recursion.
        links += [printable((place / name).as_posix()) for name in inner if Path(folder, name).is_symlink()]
        inner[:] = [name for name in inner if store is None or Path(folder, name).resolve() != store.resolve()]
        for name in names:
            file = (place / name).as_posix()
            wanted = [matches(file, each) for each in study.include] or [Path(name).suffix.lower() in suffixes]
            if any(wanted) and not name.startswith(".") and not any(matches(file, each) for each in study.exclude):
                files.append(file)
    return sorted(files), links


def _chunks(study: Study, jobs: Sequence[Job]) -> Iterator[Chunk]:
    """Group files of the same suffix and laws, and of similar size."""
    from ..fitting.chunks import blocks

    groups: dict[Any, list[Job]] = {}
    for job in jobs:
        groups.setdefault((Path(job.file).suffix.lower(), job.laws), []).append(job)
    # Laws integrated on a mesh are fitted run by run, so smaller chunks cost little and lose less if interrupted.
    parts = 1 if all(law.oscillator.friction.kind == "set-valued" for law in study.laws) else 8
    for group in groups.values():
        by_size = sorted(group, key=lambda job: job.signature.bytes)
        for block in blocks(len(group), parts):
            members = by_size[block.start : block.stop]
            totals = itertools.accumulate(job.signature.bytes for job in members)
            for _, pairs in itertools.groupby(zip(members, totals, strict=True), lambda pair: pair[1] // _LARGEST):
                yield tuple(job for job, _ in pairs)
