"""Files that anybody can have written: what is asked before they are opened, and how much may come out of them.

A path may lead to nothing, to a pipe that never ends, or to a file of a few kilobytes that declares an array of
terabytes. Sizes are therefore compared with that of the file before anything is unpacked. Settings are read here too.
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
"""Bytes that a number of any type takes as soon as it is part of a record."""
# What any file may hold unpacked: 16.7 million numbers. With the copies that a record takes this stays below 1 GB.
_ALWAYS = 1 << 27
# What a larger one may hold, as a multiple of its size on disk; traces of measured displacements are packed twofold to
# fivefold, their times up to tenfold.
_PACKED = 16
# What none may hold: 268 million numbers.
_LARGEST = 1 << 31
# Bytes of the largest file of settings, and characters of its longest line; most have a few hundred in all. The time
# that a dotted key takes grows with the square of its length, so that both together bound the reading to a second.
_LARGEST_TOML, _WIDEST_TOML = 100_000, 1_000


def check_file(path: Path) -> None:
    """Refuse a path that leads to no file, or to one that holds nothing.

    Raises:
        DataError: no such file (the nearest name is offered), a pattern, a folder, a device, or an empty file.
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
    """Why a path leads to no file, and what may be meant."""
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
            "without quotes, so that the shell puts the names in its place."
        )
    if any(sign in path.name for sign in "*?"):
        return f"There is no file {path}, and none that matches this pattern. Check the folder and the ending."
    try:
        siblings = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        siblings = []
    return f"There is no file {path}.{nearest(path.name, siblings)} Check the path."


def check_distinct(paths: Iterable[Path]) -> None:
    """Refuse a list that leads to one file twice, whose samples would then count twice.

    Raises:
        UsageError: names the file.
    """
    seen: dict[Path, Path] = {}
    for path in paths:
        first = seen.setdefault(path.resolve(), path)
        if first is not path:
            also = "" if str(first) == str(path) else f", also as {first}"
            raise UsageError(f"{path} is given twice{also}: its samples would count twice. Leave one of them out.")


def allowance(path: Path) -> int:
    """How many bytes the arrays of a file may have in all."""
    return min(max(_ALWAYS, _PACKED * path.stat().st_size), _LARGEST)


def check_size(path: Path, what: str, numbers: int) -> None:
    """Refuse what is declared larger than a file of this size can hold, before any of it is read.

    Raises:
        DataError: names the file, and `what` is declared: "'x'".
    """
    if not 0 <= numbers * NUMBER <= allowance(path):
        raise DataError(
            f"{what} in {path.name} is not read: it is declared to have {gigabytes(numbers * NUMBER)}, more than "
            "plausible for a file of this size."
        )


def library(path: Path, module: str, extra: str) -> Any:
    """The module that reads a format, of a package that an extra of this one brings.

    Raises:
        UsageError: it is not installed; says how to install it.
    """
    return needed(path.name, module, extra, "or export the run as .csv")


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


def read_toml(
    path: Path, what: str, keys: Collection[str] | None = None, required: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The table of a file of settings in TOML: of a rig, of a study, of a cluster.

    Args:
        path: the file.
        what: it describes, in a word: "rig".
        keys: those that it may have; None: whoever asks will see to that.
        required: keys that it must have, each with a value as an example.

    Raises:
        UsageError: no such file, a larger one, no TOML, an unknown key or one that is missing; names file and key.
    """
    try:
        # Editors on Windows begin a file with a mark of its encoding, which is no TOML.
        text = content(path, _LARGEST_TOML, UsageError).decode("utf-8-sig")
        if any(len(line) > _WIDEST_TOML for line in text.splitlines()):
            raise UsageError(f"{path}: this is no {what} file: a line has more than {_WIDEST_TOML} characters.")
        table = tomllib.loads(text)
    except FileNotFoundError as error:
        siblings = [entry.name for entry in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise UsageError(f"There is no {what} file '{path}'.{nearest(path.name, siblings)} Check the path.") from error
    except OSError as error:
        raise UsageError(f"The {what} file '{path}' cannot be read: {error.strerror}.") from error
    except RecursionError as error:
        raise UsageError(f"{path}: this is no {what} file: its tables are nested too deeply.") from error
    except UsageError:
        raise
    except ValueError as error:  # TOML that is none, other encodings, and numbers of thousands of digits
        raise UsageError(f"{path}: this is no valid TOML file: {str(error)[:200]}.") from error
    if keys is not None and (unknown := [key for key in table if key not in keys]):
        hint = f"{nearest(unknown[0], keys)} Known are {', '.join(keys)}."
        raise UsageError(f"{path}: there is no key {brief(unknown[0])} in a {what} file.{hint}")
    for key, example in (required or {}).items():
        if key not in table:
            raise UsageError(f"{path}: '{key}' is missing; add a line such as {key} = {example}.")
    return table


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Puts the name of a file before what is wrong with a value that stands in it.

    Raises:
        UsageError: as what is done under it, with the name.
    """
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


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
