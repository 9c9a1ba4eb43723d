"""Whether a path leads to a file that can be read at all: what is asked before anything is opened or imported."""

import os
from collections.abc import Iterable
from pathlib import Path

from ..errors import DataError, UsageError, nearest
from .content import check_regular

# Files that a sentence names as examples.
_SHOWN = 3


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
    if os.path.isdir(path):
        files = sorted(entry for entry in path.iterdir() if entry.is_file() and not entry.name.startswith("."))
        inside = f"; it holds {_named(files)}" if files else ""
        return f"{path} is a folder, not a file; name one record in it{inside}."
    if not os.path.isdir(path.parent):
        return f"There is no file {path}, for there is no folder {path.parent}. Check the path."
    matching = sorted(path.parent.glob(path.name)) if any(sign in path.name for sign in "*?[") else []
    if matching:
        return (
            f"{path} is a pattern, not a file; it matches {_named(matching)}. Name each file, or leave the pattern "
            "without quotes, so that the shell puts the names in its place."
        )
    if any(sign in path.name for sign in "*?"):
        return f"There is no file {path}, and none that matches this pattern. Check the folder and the ending."
    try:
        siblings = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        siblings = []
    return f"There is no file {path}.{nearest(path.name, siblings)} Check the path."


def _named(files: list[Path]) -> str:
    more = len(files) - _SHOWN
    return ", ".join(str(file) for file in files[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


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
