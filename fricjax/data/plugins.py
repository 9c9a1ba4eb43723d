"""Readers from other packages, found by entry point and loaded on demand.

Such a package names a function in the group `fricjax.readers`; the entry point's name is the suffix without its dot.
Errors of a plug-in are reported with its name and do not affect other readers.
"""

import functools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..errors import DataError, UsageError

GROUP = "fricjax.readers"


def suffixes() -> list[str]:
    """Return the suffixes of installed plug-ins, with dots, without loading them."""
    return [f".{_suffix(point)}" for point in _points()]


def reader_of(path: Path) -> Callable[..., Any] | None:
    """Return a plug-in's reader for a file with this suffix.

    Returns None if no plug-in is installed for the suffix.

    Raises:
        UsageError: a plug-in is installed but cannot be loaded.
    """
    faults = []
    for point in _points():
        if f".{_suffix(point)}" != path.suffix.lower():
            continue
        name = point.dist.name if point.dist is not None else point.value
        try:
            reader = point.load()
        # An import can run any code of the package, including sys.exit.
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

    # Sort, because the order of entry points depends on the search path.
    return sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value))


def _suffix(point: Any) -> str:
    return point.name.lower().removeprefix(".")


def _guarded(reader: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Wrap a reader so that its failures become `DataError`; keep its options."""

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
