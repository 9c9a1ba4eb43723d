"""Checks and size limits for files of unknown origin; TOML settings.

A path may lead to a missing file, to a pipe without end, or to a file of a few kilobytes that unpacks to terabytes.
"""

import os
import stat
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import DataError, UsageError, brief, first_of, nearest, needed

NUMBER = 8
"""Bytes that a number of any type takes in a record."""
# Unpacked size that any file may have: 16.7 million numbers. With the copies in a record this stays below 1 GB.
_ALWAYS = 1 << 27
# Unpacked size of a larger file, as a multiple of its size on disk. Measured displacements compress by a factor of 2 to
# 5, their times up to 10.
_PACKED = 16
# Unpacked size that no file may exceed: 268 million numbers.
_LARGEST = 1 << 31
# Size of the largest settings file [bytes] and length of its longest line [characters]; most have a few hundred in
# total. The parsing time of a dotted key grows with the square of its length, so both limits together bound it to 1 s.
_LARGEST_TOML, _WIDEST_TOML = 100_000, 1_000


def check_file(path: Path) -> None:
    """Refuse a path to a missing or empty file.

    Raises:
        DataError: no such file (the message offers the nearest name), a pattern, a folder, a device, or an empty file.
    """
    if os.path.isdir(path):
        raise DataError(_missing(path))
    try:
        check_regular(path)
    except OSError as error:
        raise DataError(_missing(path)) from error
    if path.stat().st_size == 0:
        raise DataError(f"{path.name} is empty: it holds no data at all.")


def _missing(path: Path) -> str:
    """Explain why there is no file at a path, with a suggestion."""
    if os.path.isdir(path):
        files = sorted(entry for entry in path.iterdir() if entry.is_file() and not entry.name.startswith("."))
        inside = f"; it holds {first_of(files)}" if files else ""
        return f"{path} is a folder, not a file; name one record in it{inside}."
    if os.path.islink(path):
        return f"There is no file at the end of the link {path}. Check where it leads."
    if not os.path.isdir(path.parent):
        return f"There is no file {path}, for there is no folder {path.parent}. Check the path."
    matching = sorted(path.parent.glob(path.name)) if any(sign in path.name for sign in "*?[") else []
    if matching:
        return (
            f"{path} is a pattern, not a file; it matches {first_of(matching)}. Name each file, or leave the pattern "
            "without quotes, so that the shell replaces it with the names."
        )
    if any(sign in path.name for sign in "*?"):
        return f"There is no file {path}, and none that matches this pattern. Check the folder and the ending."
    try:
        siblings = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        siblings = []
    return f"There is no file {path}.{nearest(path.name, siblings)} Check the path."


def printable(name: str) -> str:
    """Return a file name as text that can be stored and printed.

    Bytes that are not UTF-8 become escapes.
    """
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def check_distinct(paths: Iterable[Path]) -> None:
    """Refuse a list that contains a file twice.

    The samples of that file would count twice.

    Raises:
        UsageError: a file occurs twice; the message names it.
    """
    seen: dict[Path, Path] = {}
    for path in paths:
        first = seen.setdefault(path.resolve(), path)
        if first is not path:
            also = "" if str(first) == str(path) else f", also as {first}"
            raise UsageError(f"{path} is given twice{also}: its samples would count twice. Leave one of them out.")


def allowance(path: Path) -> int:
    """Return the largest plausible size of a file's arrays [bytes]."""
    return min(max(_ALWAYS, _PACKED * path.stat().st_size), _LARGEST)


def library(path: Path, module: str, extra: str) -> Any:
    """Import the module that reads a format, from an optional dependency."""
    return needed(path.name, module, extra, "or export the run as .csv")


def gigabytes(size: float) -> str:
    """Format a size for messages."""
    return f"{size / 1e9:.3g} GB" if size < 1e15 else "more than a million GB"


def check_regular(path: Path, refused: type[ValueError] = DataError) -> None:
    """Refuse a path that is not a regular file, without opening it.

    Opening a pipe or a device could block forever.

    Raises:
        DataError: (or `refused`) a pipe, device, socket or folder, or an invalid file name.
        FileNotFoundError: no such file.
        OSError: the path cannot be followed.
    """
    try:
        str(path).encode()
        mode = path.stat().st_mode
    except ValueError as error:  # a null character, or an unpaired UTF-16 surrogate
        raise refused(f"{ascii(str(path))[:200]} is no name of a file; rename the file.") from error
    if stat.S_ISDIR(mode):
        raise refused(f"{path} is a folder, not a file; name one file in it.")
    if not stat.S_ISREG(mode):
        raise refused(f"{path} is a device, a pipe or a socket, not a file; copy its content to a file first.")


def content(path: Path, largest: int, refused: type[ValueError] = DataError) -> bytes:
    """Read a file of at most `largest` bytes.

    Raises:
        DataError: (or `refused`) not a regular file, or a larger one.
        OSError: it does not exist or cannot be read.
    """
    check_regular(path, refused)
    # If the path is replaced by a pipe at this moment, a non-blocking open does not wait.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
        data = file.read(largest + 1) if path.stat().st_size <= largest else b""
        if len(data) > largest or path.stat().st_size > largest:
            size = gigabytes(path.stat().st_size)
            raise refused(f"{path} has {size}, but at most {gigabytes(largest)} are expected of such a file.")
    return data


def read_toml(
    path: Path, kind: str, keys: Collection[str] | None = None, required: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Read a settings file in TOML (rig or study).

    Args:
        path: the file.
        kind: kind of settings, for messages: "rig".
        keys: the allowed keys; None: the caller checks them.
        required: the required keys, each with an example value.

    Raises:
        UsageError: the file is missing, too large or not valid TOML, or has an unknown or missing key; the message
            names file and key.
    """
    try:
        # Editors on Windows write a byte order mark, which is not valid TOML.
        text = content(path, _LARGEST_TOML, UsageError).decode("utf-8-sig")
        if any(len(line) > _WIDEST_TOML for line in text.splitlines()):
            raise UsageError(f"{path}: this is no {kind} file: a line has more than {_WIDEST_TOML} characters.")
        table = tomllib.loads(text)
    except FileNotFoundError as error:
        siblings = [entry.name for entry in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise UsageError(f"There is no {kind} file '{path}'.{nearest(path.name, siblings)} Check the path.") from error
    except OSError as error:
        raise UsageError(f"The {kind} file '{path}' cannot be read: {error.strerror}.") from error
    except RecursionError as error:
        raise UsageError(f"{path}: this is no {kind} file: its tables are nested too deeply.") from error
    except UsageError:
        raise
    except ValueError as error:  # invalid TOML, other encodings, and numbers with thousands of digits
        raise UsageError(f"{path}: this is no valid TOML file: {str(error)[:200]}.") from error
    if keys is not None and (unknown := [key for key in table if key not in keys]):
        hint = f"{nearest(unknown[0], keys)} Known are {', '.join(keys)}."
        raise UsageError(f"{path}: there is no key {brief(unknown[0])} in a {kind} file.{hint}")
    for key, example in (required or {}).items():
        if key not in table:
            raise UsageError(f"{path}: '{key}' is missing; add a line such as {key} = {example}.")
    return table


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Add the name of a file to errors about its values."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
