"""Atomic writing of files.

A file appears complete or not at all, even after an interruption, and replaces another file only on request. The
content is in memory, so a full disk, a limit or a kill can interrupt the writing only in this module.
"""

import contextlib
import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator
from io import FileIO
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: temporary files of a killed process remain until someone removes them
    fcntl = None

# A temporary file has such a name. It is an orphan of a killed process if no process holds a lock on it.
_TEMPORARY = re.compile(r"\.fricjax-[0-9a-f]{16}\.tmp")
_HAS_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL, errno.ENOTSUP)
_NOTHING = "; nothing was written, and an existing file is unchanged"
_REASONS = {
    errno.ENOSPC: f"no space left on its disk{_NOTHING}",
    errno.EDQUOT: f"no space left in the quota of its disk{_NOTHING}",
    errno.EFBIG: f"no space left for a file of this size, by a limit of its disk or of the process{_NOTHING}",
    errno.EEXIST: "exists already; give overwrite=True, or another name",
    errno.ENOENT: "its folder does not exist; make it first",
    errno.EACCES: "its folder cannot be written to; give another one",
    errno.EPERM: "it is protected, or belongs to somebody else; give another name",
    errno.EROFS: "its folder cannot be written to; give another one",
    errno.EISDIR: "it is a folder; give the name of a file",
}


def write_bytes(path: str | os.PathLike[str], content: bytes | memoryview, *, overwrite: bool = False) -> Path:
    """Write a file atomically and flush it to the disk.

    A symbolic link is followed. A file that replaces another keeps the mode and, if the process has the permission, the
    owner and group. A new file gets the default mode of the process. Several processes or threads may write the same
    file at the same time. Without `overwrite` one of them succeeds, with `overwrite` the last one wins.

    Args:
        path: the file; its folder must exist.
        content: the complete content.
        overwrite: replace an existing file.

    Returns:
        The path.

    Raises:
        FileExistsError: the file exists, and `overwrite` is False.
        OSError: the file cannot be written: no folder, no permission, no space. The error has `path` as its file name,
            and an existing file is unchanged.
    """
    target, existing = Path(os.path.realpath(path)), None
    try:
        with contextlib.suppress(FileNotFoundError):
            existing = target.stat()
        if existing is not None and stat.S_ISDIR(existing.st_mode):
            raise IsADirectoryError(errno.EISDIR, "")
        if existing is not None and not overwrite:
            raise FileExistsError(errno.EEXIST, "")
        _remove_orphans(target.parent)
        # Nobody else may read a replacement before it has the mode of the file that it replaces.
        with _temporary(target.parent, 0o666 if existing is None else 0o600) as file:
            _fill(file, content, existing)
            _publish(Path(file.name), target, overwrite)
        # The name reaches the disk with the folder; not every system can flush a folder.
        with contextlib.suppress(OSError):
            folder = os.open(target.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
    except OSError as error:
        raise refused(error.errno, path) from error
    return Path(path)


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a text file in UTF-8 with `write_bytes`."""
    return write_bytes(path, text.encode("utf-8"), overwrite=overwrite)


def refused(code: int | None, path: str | os.PathLike[str]) -> OSError:
    """Return the error for an unwritable file, with a remedy."""
    known = errno.EIO if code is None else code
    return OSError(known, _REASONS.get(known, os.strerror(known)), str(path))


@contextlib.contextmanager
def _temporary(folder: Path, mode: int) -> Iterator[FileIO]:
    """Open an empty, locked temporary file in the folder of the target.

    The lock lasts as long as the process lives. The file is removed at the end unless it was moved.
    """
    while True:
        path = folder / f".fricjax-{secrets.token_hex(8)}.tmp"
        # The kernel applies the umask to the mode. A process can read the umask only by changing it for all threads.
        file = FileIO(path, "x+", opener=lambda name, flags: os.open(name, flags, mode))
        if fcntl is None:
            break
        # Some network disks have no locks. Orphans cannot be locked there either, so they remain.
        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        # Another process may have removed the file as an orphan before it was locked.
        if os.fstat(file.fileno()).st_nlink:
            break
        file.close()
    try:
        yield file
    finally:
        # Remove the file before the lock is released, or another process could treat it as an orphan.
        Path(file.name).unlink(missing_ok=True)
        file.close()


def _remove_orphans(folder: Path) -> None:
    """Remove unlocked temporary files that killed processes left in a folder."""
    if fcntl is None:
        return
    with os.scandir(folder) as entries:
        names = [entry.path for entry in entries if _TEMPORARY.fullmatch(entry.name)]
    for name in names:
        # The file may have disappeared, be locked, or belong to another user.
        with contextlib.suppress(OSError):
            handle = os.open(name, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(name)
            finally:
                os.close(handle)


def _fill(file: FileIO, content: bytes | memoryview, existing: os.stat_result | None) -> None:
    """Write the content, with mode and owner of the replaced file."""
    rest = memoryview(content).cast("B")
    while rest:
        rest = rest[file.write(rest) :]
    if existing is not None and hasattr(os, "fchown"):
        # Only root may change the owner; the group may be one to which the user belongs.
        for owner in ((existing.st_uid, existing.st_gid), (-1, existing.st_gid)):
            with contextlib.suppress(OSError):
                os.fchown(file.fileno(), *owner)
                break
        # Set the mode after the owner, because a change of owner clears bits of the mode.
        os.fchmod(file.fileno(), stat.S_IMODE(existing.st_mode))
    os.fsync(file.fileno())
    if fcntl is None:
        # Windows does not move an open file.
        file.close()


def _publish(temporary: Path, target: Path, overwrite: bool) -> None:
    """Rename the file atomically; replace a file only on request."""
    if not overwrite:
        try:
            os.link(temporary, target)
            return
        except OSError as error:
            if error.errno not in _HAS_NO_LINKS:
                raise
        if target.exists():
            raise FileExistsError(errno.EEXIST, "")
    os.replace(temporary, target)
