"""The folder of compiled programs: whose it may be, how large, and entries that are whole or made again.

What lies in the folder is executed, so nobody else may be able to write there. Each entry begins with a digest of what
follows: one that a full disk, a kill or a failing disk has damaged is removed when it is read, and its maker compiles
again and writes it anew. JAX never replaces an entry, and hands damaged ones to XLA; so it is given this store.
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
# The programs of all laws together are a few hundred megabytes. What is too much goes when a process begins, and some
# more with it, so that not each of them has to.
_LARGEST, _KEPT = 1 << 30, 0.8
# An entry is written in far less than a second; after an hour its writer has been killed.
_UNFINISHED, _ABANDONED = ".unfinished", 3600.0
_EVERYBODY = stat.S_IWGRP | stat.S_IWOTH


class Store:
    """Compiled programs of JAX in a folder, each whole or not there; what JAX asks of a cache is `get` and `put`."""

    def __init__(self, folder: Path) -> None:
        self._path = folder

    def get(self, key: str) -> bytes | None:
        """The program of a key; None where it has to be compiled."""
        return recall(self._path / f"{key}-kept")

    def put(self, key: str, value: bytes) -> None:
        """Keep the program of a key."""
        keep(self._path / f"{key}-kept", value)


def recall(place: Path) -> bytes | None:
    """What was kept in a file; None where there is none, or a damaged one, which is removed."""
    try:
        data = place.read_bytes()
    except OSError:
        return None
    begin = len(_HEAD) + _DIGEST
    content = data[begin:]
    intact = data[:begin] == _HEAD + _digest(content)
    with contextlib.suppress(OSError):
        # What was used last is let go last.
        place.touch() if intact else place.unlink()
    return content if intact else None


def keep(place: Path, content: bytes) -> None:
    """Keep something: all of it or, where the disk is full or not ours, nothing.

    The digest tells what did not reach the disk, so nobody waits for it.
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
    """The folder of compiled programs that is asked for, whether it can be used or not; None where it is off."""
    named = os.environ.get(CACHE_VARIABLE)
    if named is not None and named.strip().lower() in _OFF:
        return None
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return (Path(named).expanduser() if named else home / "fricjax") / _processor()


def _processor() -> str:
    """A short name for this kind of processor: in a shared folder, code for another one must not be loaded."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        features = next(line for line in lines if line.lower().startswith(("flags", "features")))
    except (OSError, StopIteration):
        features = platform.processor()
    return f"{platform.machine()}-{zlib.crc32(features.encode()):08x}"


def made(folder: Path) -> bool:
    """Make the folder of compiled programs, for its user alone; False where it is not there and cannot be made."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def distrust(folder: Path) -> str | None:
    """Why nothing that lies in a folder may be executed, and what to do about it; None where all is well.

    The folder must be the user's alone to write to, and nobody else may be able to put another one in its place.
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
            return f"{place} belongs to another user, and what lies there is executed; {remedy}."
        # Where the sticky bit is set, as in /tmp, others may add folders but not replace this one.
        if status.st_mode & _EVERYBODY and (place == folder or not status.st_mode & stat.S_ISVTX):
            return f"others can write to {place}, and what lies there is executed; 'chmod go-w {place}', or {remedy}."
    return None


def prune(folder: Path, largest: int = _LARGEST) -> None:
    """Let the programs go that were not used for the longest time, where all together are larger than `largest` bytes.

    Another process may do the same at the same time, so that a file may be gone.
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
