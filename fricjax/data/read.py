"""One entry for every format: the suffix of the file chooses the reader.

Readers of further formats join through the entry point group `fricjax.readers`: the name of the entry point is the
suffix without its dot, the object a function `(path, **options) -> Record`.
"""

import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .content import check_regular
from .errors import DataError, UsageError, nearest
from .record import Record

READERS = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tsv", ".asc"), ("csv", "read_csv")),
    ".npz": ("npz", "read_npz"),
    ".mat": ("mat", "read_mat"),
    **dict.fromkeys((".h5", ".hdf5", ".nc"), ("hdf5", "read_hdf5")),
}
PLUGIN_GROUP = "fricjax.readers"


def read(path: str | Path, **options: Any) -> Record:
    """Reads a displacement record from a file of any supported format.

    Args:
        path: a `.csv`, `.txt`, `.dat`, `.tsv`, `.asc`, `.npz`, `.mat`, `.h5`, `.hdf5` or `.nc` file, or one for which a
            plug-in is installed.
        **options: for every format

            - `column`, `time`: the columns of displacement and time, by name or index (text formats), variable
              (`.npz`, `.mat`: also `"s.signals.values"`, `"cells[0]"`, `"a+b"`) or path (`.h5`: `"/run1/x"`)
            - `unit`, `time_unit`: their units, instead of those in the file (default m and s)
            - `rate`: samples per second, for a file without times
            - `sigma`: standard deviation of the noise, in the unit of the displacement
            - `sign`: -1 turns the direction round

            and for text formats `delimiter`, `decimal`, `comment`, `skip_rows`, `header`, `encoding`; for `.mat`
            files `row` and `cells`.

    Returns:
        A `Record` in SI units: metres or radians over seconds. Samples without a value are masked and counted in its
        log.

    Raises:
        DataError: the file is missing, of an unknown format, damaged, or holds no usable record.
        UsageError: an option is unknown to the format or contradicts another.
    """
    path = Path(path)
    try:
        check_regular(path)
    except OSError as error:
        raise DataError(_missing(path)) from error
    if path.stat().st_size == 0:
        raise DataError(f"{path.name} is empty: it holds no data at all.")
    reader = _reader(path)
    _check_options(reader, path, options)
    return reader(path, **options)


def _missing(path: Path) -> str:
    try:
        siblings = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        siblings = []
    return f"There is no file {path}.{nearest(path.name, siblings)} Check the path."


def _reader(path: Path) -> Callable[..., Record]:
    suffix = path.suffix.lower()
    if suffix in READERS:
        module, name = READERS[suffix]
        return getattr(importlib.import_module(f".readers.{module}", __package__), name)
    plugins = _plugins()
    if suffix.removeprefix(".") in plugins:
        return plugins[suffix.removeprefix(".")].load()
    known = ", ".join([*READERS, *(f".{name}" for name in plugins)])
    got = f"the suffix '{path.suffix}'" if path.suffix else "no suffix"
    raise DataError(f"{path.name} is of an unknown format: it has {got}, and known are {known}. Export it as .csv.")


def _plugins() -> dict[str, Any]:
    from importlib.metadata import entry_points

    return {point.name.lower().removeprefix("."): point for point in entry_points(group=PLUGIN_GROUP)}


def _check_options(reader: Callable[..., Record], path: Path, options: dict[str, Any]) -> None:
    parameters = inspect.signature(reader).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    known = [name for name, parameter in parameters.items() if parameter.kind is parameter.KEYWORD_ONLY]
    for name in options:
        if name not in known:
            raise UsageError(
                f"'{name}' is no option for {path.suffix} files.{nearest(name, known)} Options are {', '.join(known)}."
            )
