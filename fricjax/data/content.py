"""Files that anybody can have written: what is looked at before they are read, and how much may come out of them.

A file of a few kilobytes can declare an array of terabytes or be compressed a thousandfold. Sizes are therefore
compared with that of the file before anything is unpacked.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import DataError, UsageError

# What any file may hold unpacked: 16.7 million numbers. With the copies that a record takes this stays below 1 GB.
_ALWAYS = 1 << 27
# What a larger one may hold, as a multiple of its size on disk; traces of measured displacements are packed twofold to
# fivefold, their times up to tenfold.
_PACKED = 16
# What none may hold: 268 million numbers.
_LARGEST = 1 << 31


NUMBER = 8
"""Bytes that a number of any type takes as soon as it is part of a record."""


def allowance(path: Path) -> int:
    """How many bytes the arrays of a file may have in all."""
    return min(max(_ALWAYS, _PACKED * path.stat().st_size), _LARGEST)


def gigabytes(size: float) -> str:
    """A size in words, for messages."""
    return f"{size / 1e9:.3g} GB" if size < 1e15 else "more than a million GB"


def check_regular(path: Path, refused: type[ValueError] = DataError) -> None:
    """Refuses what is no file of the disk without opening it, for opening a pipe or a device may wait for ever.

    Raises:
        DataError: (or what `refused` says) a pipe, device, socket or folder, or a name that no file can have.
        FileNotFoundError: no such file.
        OSError: the path cannot be followed.
    """
    try:
        str(path).encode()
        mode = path.stat().st_mode
    except ValueError as error:  # a null character, or one half of a pair of UTF-16
        raise refused(f"{ascii(str(path))[:200]} is no name of a file; rename the file.") from error
    if stat.S_ISDIR(mode):
        raise refused(f"{path} is a folder, not a file; name one file in it.")
    if not stat.S_ISREG(mode):
        raise refused(f"{path} is a device, a pipe or a socket, not a file; copy its content to a file first.")


def content(path: Path, largest: int, refused: type[ValueError] = DataError) -> bytes:
    """The bytes of a file that has at most `largest` of them.

    Raises:
        DataError: (or what `refused` says) no file of the disk, or a larger one.
        OSError: it does not exist or cannot be read.
    """
    check_regular(path, refused)
    # Should the file be exchanged for a pipe at this moment, opening it does not wait.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
        data = file.read(largest + 1) if path.stat().st_size <= largest else b""
        if len(data) > largest or path.stat().st_size > largest:
            size = gigabytes(path.stat().st_size)
            raise refused(f"{path} has {size}, but at most {gigabytes(largest)} are expected of such a file.")
    return data


@contextmanager
def damage(path: Path, kind: str, hint: str = "it is damaged or of another format") -> Iterator[None]:
    """Turns whatever a library raises while it reads a damaged file into one sentence.

    What the readers of zip, HDF5 and MATLAB files raise for bytes that they do not expect is not documented, and ranges
    from zlib.error to RecursionError; only a refusal of this package passes as it is.

    Raises:
        DataError: the file cannot be read.
    """
    try:
        yield
    except (DataError, UsageError):
        raise
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise DataError(f"{path.name} cannot be read as {kind} ({words[:120]}); {hint}.") from error
