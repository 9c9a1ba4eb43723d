"""The folder of compiled programs: owner, size, and complete entries.

Entries of the folder are executed, so no other user may be able to write there. Each entry begins with a digest of its
content. A damaged entry (full disk, kill, failing disk) is removed when it is read, and the program is compiled and
written again. JAX by default never replaces an entry and hands damaged ones to XLA, so this module gives JAX a store.
"""

import contextlib
import hashlib
import os
import platform
import secrets
import stat
import time
import zlib
from pathlib import Path

CACHE_VARIABLE = "FRICJAX_CACHE_DIR"
_OFF = ("", "off", "none", "0")
_HEAD, _DIGEST = b"fricjax kept program 2\n", 32
# The programs of all laws together take a few hundred megabytes. A process that finds more at its start removes entries
# until 80 % of the limit is left, so that the next processes need not.
_LARGEST, _KEPT = 1 << 30, 0.8
# An entry is written in far less than a second; after an hour its writer has been killed.
_UNFINISHED, _ABANDONED = ".unfinished", 3600.0
_EVERYBODY = stat.S_IWGRP | stat.S_IWOTH


class Store:
    """Cache of compiled programs with the interface of JAX (`get`, `put`)."""

    def __init__(self, folder: Path) -> None:
        self._path = folder

    def get(self, key: str) -> bytes | None:
        """Return the program of a key, None if it must be compiled."""
        return recall(self._path / f"{key}-kept")

    def put(self, key: str, value: bytes) -> None:
        """Keep the program of a key."""
        keep(self._path / f"{key}-kept", value)


def recall(place: Path) -> bytes | None:
    """Return the content of an entry, or None if missing or damaged."""
    try:
        data = place.read_bytes()
    except OSError:
        return None
    begin = len(_HEAD) + _DIGEST
    content = data[begin:]
    intact = data[:begin] == _HEAD + _digest(content)
    with contextlib.suppress(OSError):
        # The time of last use decides which entries are removed first.
        place.touch() if intact else place.unlink()
    return content if intact else None


def keep(place: Path, content: bytes) -> None:
    """Write an entry completely or not at all.

    There is no fsync: the digest shows later if the content did not reach the disk.
    """
    # Another process or thread may write the same at the same time.
    scratch = place.with_name(f"{place.name}-{secrets.token_hex(8)}{_UNFINISHED}")
    try:
        scratch.write_bytes(_HEAD + _digest(content) + content)
        scratch.replace(place)
    except OSError:
        with contextlib.suppress(OSError):
            scratch.unlink(missing_ok=True)


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_DIGEST).digest()


def asked_folder() -> Path | None:
    """Return the folder of compiled programs, None if switched off."""
    named = os.environ.get(CACHE_VARIABLE)
    if named is not None and named.strip().lower() in _OFF:
        return None
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return (Path(named).expanduser() if named else home / "fricjax") / _processor()


def _processor() -> str:
    """Return a short name of the processor type.

    Code for one type must not be loaded by another from a shared folder.
    """
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        features = next(line for line in lines if line.lower().startswith(("flags", "features")))
    except (OSError, StopIteration):
        features = platform.processor()
    return f"{platform.machine()}-{zlib.crc32(features.encode()):08x}"


def made(folder: Path) -> bool:
    """Create a private folder; return True if it is writable."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def distrust(folder: Path) -> str | None:
    """Return a reason not to trust a folder, or None.

    Only the user may be able to write to the folder or to replace it.
    """
    if not hasattr(os, "getuid"):
        return None
    remedy = f"name a folder of your own in {CACHE_VARIABLE}"
    for place, owners in ((folder, (os.getuid(),)), (folder.parent, (os.getuid(), 0))):
        try:
            status = place.stat()
        except OSError:
            continue
        if status.st_uid not in owners:
            return f"{place} belongs to another user, and programs there are executed; {remedy}."
        # With the sticky bit, as in /tmp, others may add folders but not replace this one.
        if status.st_mode & _EVERYBODY and (place == folder or not status.st_mode & stat.S_ISVTX):
            return f"others can write to {place}, and programs there are executed; 'chmod go-w {place}', or {remedy}."
    return None


def prune(folder: Path, largest: int = _LARGEST) -> None:
    """Remove the least recently used programs if the folder exceeds `largest` bytes.

    Another process may remove files at the same time.
    """
    files = []
    for path in folder.iterdir():
        try:
            status = path.stat()
            if path.name.endswith(_UNFINISHED) and status.st_mtime < time.time() - _ABANDONED:
                path.unlink()
            else:
                files.append((status, path))
        except OSError:
            continue
    size = sum(status.st_size for status, _ in files)
    if size <= largest:
        return
    for status, path in sorted(files, key=lambda each: max(each[0].st_atime, each[0].st_mtime)):
        if size <= _KEPT * largest:
            return
        path.unlink(missing_ok=True)
        size -= status.st_size
