"""Store: the folder with the records of an archive.

    study.json        models and settings
    parts/*.parquet   rows of finished chunks; written once, never changed
    table.parquet     all rows, merged from the parts at the end of each run
    runs/KEY.nc       optional residuals of a run

Files are written atomically. A row in a part is finished; after a crash, the next driver continues from there.
"""

import contextlib
import io
import json
import os
import platform
import re
import secrets
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from ..data.files import content
from ..errors import DataError, UsageError, brief, needed, path_of
from ..show.files import write_bytes, write_text
from .study import SCHEMA, Study
from .table import joined, note, of_rows, without_facts

try:
    import fcntl
except ImportError:  # Windows, without locks against a second driver
    fcntl = None

_STUDY, _TABLE, _PARTS, _RUNS = "study.json", "table.parquet", "parts", "runs"
_PART = re.compile(r"\d{20}-[0-9a-f]{8}\.parquet")
# Largest size of study.json in bytes.
_LARGEST = 10_000_000
# Seconds before another attempt to lock; a status query holds the lock only for a moment.
_GLANCE = 0.05


class Store:
    """Records of an archive in a folder."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path_of(path)

    @property
    def exists(self) -> bool:
        """True if the folder contains a store."""
        return (self.path / _STUDY).is_file()

    def description(self) -> dict[str, Any]:
        """Read models and settings of the store.

        Raises:
            DataError: no store, or another schema.
        """
        file = self.path / _STUDY
        try:
            described = json.loads(content(file, _LARGEST))
            schema = described.get("schema")
        except FileNotFoundError as error:
            raise DataError(
                f"{self.path} holds no archive: there is no {_STUDY} in it. Make one: fricjax batch."
            ) from error
        except (AttributeError, ValueError) as error:
            raise DataError(f"{file} is no description of an archive: {str(error)[:200]}.") from error
        if schema != SCHEMA:
            raise DataError(f"{file} has the schema {brief(schema)}, and {SCHEMA!r} is known. Use another version.")
        return described

    def begin(self, study: Study) -> None:
        """Record the study, after `check`."""
        asked = self.check(study)
        if not self.exists or asked != {**self.description(), "versions": asked["versions"]}:
            write_text(self.path / _STUDY, json.dumps(asked, indent=1) + "\n", overwrite=True)

    def check(self, study: Study) -> dict[str, Any]:
        """Return the description of a study with all stored laws."""
        asked = json.loads(json.dumps(study.described(), default=repr))
        if not self.exists:
            return asked
        known = self.description()
        difference = _difference(known, asked)
        if difference:
            raise UsageError(
                f"{self.path} holds the records of another study: {difference}. Give another folder, or the same "
                "settings."
            )
        return {**asked, "laws": {**known["laws"], **asked["laws"]}}

    @contextlib.contextmanager
    def locked(self, shard: tuple[int, int] = (1, 1)) -> Iterator[None]:
        """Lock the store against other drivers.

        A driver of a shard only excludes drivers of the same shard and of all files.

        Raises:
            UsageError: another driver is at work, or the folder contains other files.
        """
        entries = [] if not self.path.is_dir() else [e for e in os.listdir(self.path) if not e.startswith(".")]
        # A driver that was killed before it wrote the description may have left empty folders.
        only_empty = all(name in (_PARTS, _RUNS) and not os.listdir(self.path / name) for name in entries)
        if not (only_empty or self.exists) or (self.path.exists() and not self.path.is_dir()):
            raise UsageError(f"{self.path} exists and holds no archive. Give the name of a new folder.")
        self.path.mkdir(parents=True, exist_ok=True)
        part, parts = shard
        locks = {".lock": True} if parts == 1 else {".lock": False, f".lock-{part}-of-{parts}": True}
        with contextlib.ExitStack() as stack:
            for name, exclusive in locks.items():
                file = stack.enter_context(open(self.path / name, "a+", encoding="utf-8"))
                free = _lock(file, exclusive)
                file.seek(0)
                if not free:
                    holder = ", ".join(filter(None, [str(self.path), file.read(200).strip()]))
                    raise UsageError(
                        f"Another driver is at work on {holder}. Wait until it has ended, or let each have a part of "
                        "the runs: --shard 1/2 and --shard 2/2."
                    )
                file.truncate()
                file.write(f"process {os.getpid()} on {platform.node()}")
                file.flush()
            yield

    def driver(self) -> str:
        """Return the driver at work, as "process 1234 on host", or nothing."""
        with contextlib.suppress(FileNotFoundError), open(self.path / ".lock", encoding="utf-8") as file:
            if not _lock(file, True):
                return file.read(200).strip()
        return ""

    def write_part(self, table: Any, files: Mapping[str, bytes] | None = None) -> None:
        """Write finished rows, after the netCDF files of their residuals by key."""
        for folder in (_PARTS, _RUNS) if files else (_PARTS,):
            (self.path / folder).mkdir(exist_ok=True)
        for key, content_ in (files or {}).items():
            write_bytes(self.path / _RUNS / f"{key}.nc", content_, overwrite=True)
        # Later parts have larger numbers, whatever the clock says. A random suffix separates simultaneous drivers.
        last = max((int(n[:20]) for n in os.listdir(self.path / _PARTS) if _PART.fullmatch(n)), default=0)
        name = f"{last + 1:020d}-{secrets.token_hex(4)}.parquet"
        write_bytes(self.path / _PARTS / name, _parquet(table))

    def records(self) -> list[dict[str, Any]]:
        """Return the columns of each row that a plan needs."""
        columns = ["file", "status", "settings", "sha256", "bytes", "modified", "inode"]
        return self.merged()[0].select(columns).to_pylist() if self.exists else []

    def relabel(self, moved: Mapping[tuple[str, str], Sequence[Mapping[str, Any]]]) -> None:
        """Write new columns of moved files, by hash and settings."""
        table = without_facts(self.merged()[0])
        pairs = zip(table.column("sha256").to_pylist(), table.column("settings").to_pylist(), strict=True)
        rows = table.take([i for i, pair in enumerate(pairs) if pair in moved]).to_pylist()
        # Files with the same bytes have equal rows except for these columns.
        runs = {(row["sha256"], row["settings"], row["run"]): row for row in rows}
        updated = [{**row, **columns} for (*pair, _), row in runs.items() for columns in moved[tuple(pair)]]
        self.write_part(of_rows(updated))

    def write_table(self, root: Path) -> None:
        """Merge all parts into the table unless it is up to date."""
        # If two drivers write at once, the last table wins; it names its parts, and the others are read again.
        table, current = self.merged(root)
        if not current:
            write_bytes(self.path / _TABLE, _parquet(table), overwrite=True)

    def merged(self, root: Path | None = None) -> tuple[Any, bool]:
        """Return all rows, and whether the stored table has all of them."""
        facts, tables = self.description()["facts"], []
        if (self.path / _TABLE).is_file():
            tables.append(("", _read(self.path / _TABLE)))
        merged = set(note(tables[0][1], "parts")) if tables else set()
        with contextlib.suppress(FileNotFoundError):
            names = sorted(n for n in os.listdir(self.path / _PARTS) if n.endswith(".parquet") and n[0] != ".")
            tables += [(name, _read(self.path / _PARTS / name)) for name in names if name not in merged]
        if not tables:
            return of_rows([]), True
        if merged and len(tables) == 1 and note(tables[0][1], "templates") == facts:
            return tables[0][1], True
        return joined(tables, facts, root), False


def _parquet(table: Any) -> memoryview:
    buffer = io.BytesIO()
    needed("An archive", "pyarrow.parquet", "batch").write_table(table, buffer, compression="zstd")
    return buffer.getbuffer()


def _read(path: Path) -> Any:
    parquet = needed("An archive", "pyarrow.parquet", "batch")
    try:
        return parquet.ParquetFile(path).read()
    except (OSError, ValueError) as error:
        raise DataError(
            f"{path} cannot be read ({' '.join(str(error).split())[:120]}). Remove it and start again: its runs are "
            "fitted again."
        ) from error


def _lock(file: IO[str], exclusive: bool) -> bool:
    """Lock a file until it is closed, if it is free."""
    # Some network drives, and Windows, have no locks; there the lock always succeeds.
    if fcntl is None:
        return True
    kind = fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH
    for patience in (_GLANCE, _GLANCE, 0.0):
        try:
            fcntl.flock(file, kind | fcntl.LOCK_NB)
            return True
        except (BlockingIOError, PermissionError):
            time.sleep(patience)
        except OSError:
            return True
    return False


def _difference(known: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """Describe the first relevant setting that differs, empty for none."""
    for law, setting in asked["laws"].items():
        if known["laws"].get(law, setting) != setting:
            return f"the law {law} was fitted with other coefficients or free parameters"
    for name in sorted({*known["settings"], *asked["settings"]}):
        before, now = known["settings"].get(name), asked["settings"].get(name)
        if before != now:
            return f"{name} was {brief(before)}, and is {brief(now)} now"
    if known["rules"] != asked["rules"] or known["calibrated"] != asked["calibrated"]:
        return "its runs were read otherwise, or are of other rigs"
    # A folder moved or copied together with its store counts as the same.
    if known["root"] != asked["root"] and os.path.isdir(known["root"]):
        return f"its runs are in {known['root']}, and not in {asked['root']}"
    return ""
