"""Files that appear complete or not at all, whatever interrupts their writing, and replace others only where asked to.

What is to be written lies in memory, so that a full disk, a limit or a kill can meet one place only, which is here.
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
except ImportError:  # Windows, where what a killed process leaves stays until somebody removes it
    fcntl = None

# What a killed process leaves is known by this name, and by nobody holding a lock on it.
_TEMPORARY = re.compile(r"\.fricjax-[0-9a-f]{16}\.tmp")
_HAS_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL, errno.ENOTSUP)
_NOTHING = "; nothing was written, and what was there is as it was"
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
    """Write a file, which appears complete or not at all, and is on the disk when this returns.

    Where `path` is a symbolic link, the file that it names is written. A file that is replaced hands on its mode and,
    where the process may do so, its owner and group; a new one gets the mode that the process gives to files. Other
    processes and threads may write the same file at the same time: without `overwrite` one of them does, and with it
    the last one stays.

    Args:
        path: the file; its folder must exist.
        content: all of it.
        overwrite: replace a file that exists.

    Returns:
        The path.

    Raises:
        FileExistsError: there is such a file, and `overwrite` is not given.
        OSError: it cannot be written: no folder, no permission, no space. The error carries `path` as its file name,
            and nothing has changed.
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
        # What replaces a file is nobody else's to read until it has the mode of that file.
        with _temporary(target.parent, 0o666 if existing is None else 0o600) as file:
            _fill(file, content, existing)
            _publish(Path(file.name), target, overwrite)
        # The name is on the disk once its folder is; not every system can write a folder down.
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
    """Write a text file in UTF-8 as `write_bytes` does."""
    return write_bytes(path, text.encode("utf-8"), overwrite=overwrite)


def refused(code: int | None, path: str | os.PathLike[str]) -> OSError:
    """The error of a file that cannot be written, with a reason that says what to do where that is known."""
    known = errno.EIO if code is None else code
    return OSError(known, _REASONS.get(known, os.strerror(known)), str(path))


@contextlib.contextmanager
def _temporary(folder: Path, mode: int) -> Iterator[FileIO]:
    """An empty file beside the target, locked as long as its process lives; gone at the end unless it was moved."""
    while True:
        path = folder / f".fricjax-{secrets.token_hex(8)}.tmp"
        # The kernel applies the umask to the mode; a process can learn it only by changing it, for all its threads.
        file = FileIO(path, "x+", opener=lambda name, flags: os.open(name, flags, mode))
        if fcntl is None:
            break
        # Some network disks know no locks; there nobody can lock an orphan either, and all stay.
        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        # Before it was locked, another process may have taken it for an orphan.
        if os.fstat(file.fileno()).st_nlink:
            break
        file.close()
    try:
        yield file
    finally:
        # Before the lock goes, or others might find the file and take it for an orphan.
        Path(file.name).unlink(missing_ok=True)
        file.close()


def _remove_orphans(folder: Path) -> None:
    """Remove what killed processes have left in a folder: temporary files on which nobody holds the lock."""
    if fcntl is None:
        return
    with os.scandir(folder) as entries:
        names = [entry.path for entry in entries if _TEMPORARY.fullmatch(entry.name)]
    for name in names:
        # It may be gone by now, locked, or somebody else's.
        with contextlib.suppress(OSError):
            handle = os.open(name, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(name)
            finally:
                os.close(handle)


def _fill(file: FileIO, content: bytes | memoryview, existing: os.stat_result | None) -> None:
    """Write the content down to the disk, with mode and owner of the file that it replaces."""
    rest = memoryview(content).cast("B")
    while rest:
        rest = rest[file.write(rest) :]
    if existing is not None and hasattr(os, "fchown"):
        # Only root may give files away; the group may be one of ours.
        for owner in ((existing.st_uid, existing.st_gid), (-1, existing.st_gid)):
            with contextlib.suppress(OSError):
                os.fchown(file.fileno(), *owner)
                break
        # After the owner, whose change takes bits away.
        os.fchmod(file.fileno(), stat.S_IMODE(existing.st_mode))
    os.fsync(file.fileno())
    if fcntl is None:
        # Windows moves no file that is open.
        file.close()


def _publish(temporary: Path, target: Path, overwrite: bool) -> None:
    """Give the file its name, in one step that replaces nothing unless asked to."""
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
