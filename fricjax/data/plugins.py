"""Readers that other packages bring: found by their entry points, loaded when a file has their suffix, never before.

A package of that kind names a function in the group `fricjax.readers`, by the suffix without its dot. What it does
wrong, its own file or its own reader, counts as its fault, and no other reader suffers from it.
"""

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..errors import DataError, UsageError

GROUP = "fricjax.readers"


def suffixes() -> list[str]:
    """The suffixes, with their dots, for which a plug-in is installed; none is loaded."""
    return [f".{_suffix(point)}" for point in _points()]


def reader_of(path: Path) -> Callable[..., Any] | None:
    """The reader that a plug-in has for a file of this suffix; None where there is none.

    Raises:
        UsageError: there is one, and it cannot be loaded.
    """
    faults = []
    for point in _points():
        if f".{_suffix(point)}" != path.suffix.lower():
            continue
        name = point.dist.name if point.dist is not None else point.value
        try:
            reader = point.load()
        # Importing runs whatever the package does, down to sys.exit.
        except (Exception, SystemExit) as error:
            faults.append(f"{name} ({type(error).__name__}: {' '.join(str(error).split())[:120]})")
            continue
        if callable(reader):
            return _guarded(reader, name)
        faults.append(f"{name} ('{point.value}' is no function)")
    if faults:
        raise UsageError(
            f"{path.name} cannot be read, for the plug-in for {path.suffix} files does not load: "
            f"{', nor '.join(faults)}. Repair or uninstall it, or export the file as .csv."
        )
    return None


def _points() -> Iterable[Any]:
    from importlib.metadata import entry_points

    # Always in the same order, whatever the folders are searched in.
    return sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value))


def _suffix(point: Any) -> str:
    return point.name.lower().removeprefix(".")


def _guarded(reader: Callable[..., Any], name: str) -> Callable[..., Any]:
    """A reader whose failures become one sentence, with the options of the original."""

    @functools.wraps(reader)
    def guarded(path: Path, *arguments: Any, **options: Any) -> Any:
        from .record import Record

        try:
            result = reader(path, *arguments, **options)
        except (DataError, UsageError):
            raise
        except Exception as error:
            words = " ".join(str(error).split()) or type(error).__name__
            raise DataError(f"{path.name} cannot be read by the plug-in {name} ({words[:120]}).") from error
        records = result if isinstance(result, list) else [result]
        if not records or not all(isinstance(record, Record) for record in records):
            raise DataError(f"The plug-in {name} gave {type(result).__name__} for {path.name}, and no record.")
        return result

    return guarded
