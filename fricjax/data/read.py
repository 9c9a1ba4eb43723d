"""One entry for every source of a record: a file is read by its suffix, what is in memory by what it is.

Readers of further formats join through the entry point group `fricjax.readers`: the name of the entry point is the
suffix without its dot, the object a function `(path, choice, **options)` that gives a record, or a list for all runs.

The example that comes with the package is a synthetic run: a mass of 0.41 kg on leaf springs (12.6 Hz) under a load of
9.66 N, with mu = 0.02, is kept at 2 mm by a magnet, released, and comes to rest after some thirteen half-cycles; 5 kHz,
5 nm of noise. `meta["coefficients"]` of the record holds the truth.
"""

import dataclasses
import importlib
import inspect
import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from ..errors import DataError, UsageError, nearest
from .files import check_file
from .readers.choice import Choice

if TYPE_CHECKING:
    from .record import Record

READERS = {
    **dict.fromkeys((".csv", ".txt", ".dat", ".tsv", ".asc", ".lvm", ".log", ".prn", ".tab"), ("csv", "read_csv")),
    ".npz": ("npz", "read_npz"),
    ".mat": ("mat", "read_mat"),
    **dict.fromkeys((".xlsx", ".xlsm"), ("excel", "read_excel")),
    **dict.fromkeys((".h5", ".hdf5"), ("hdf5", "read_hdf5")),
    ".nc": ("netcdf", "read_netcdf"),
    ".tdms": ("tdms", "read_tdms"),
    **dict.fromkeys((".parquet", ".pq"), ("parquet", "read_parquet")),
    **dict.fromkeys((".uff", ".unv"), ("uff", "read_uff")),
    **dict.fromkeys((".mf4", ".mdf"), ("mdf", "read_mdf")),
}
# Options of every file and table.
_COMMON = tuple(field.name for field in dataclasses.fields(Choice))
# Done to the record, whatever it is read from.
_REPAIR = "repair"


@overload
def read(source: Any, *, run: Literal["all"], **options: Any) -> "list[Record]": ...
@overload
def read(source: Any, **options: Any) -> "Record": ...
def read(source: Any, **options: Any) -> Any:
    """Reads a displacement record from a file of any supported format, or from what is in memory.

    Args:
        source: a path, a table, arrays, a trace or a record. Files are texts (`.csv`, `.txt`, `.dat`, `.tsv`, `.asc`,
            `.lvm`, `.log`, `.prn`, `.tab`), `.npz`, `.mat`, `.h5`, `.hdf5` or `.nc`, with their extras `.xlsx`,
            `.tdms`, `.parquet`, `.uff`, `.unv` or `.mf4`, or of a format for which a plug-in is installed. Tables are
            those of pandas or polars (the index is the time where it is named so, or holds dates, durations or decimal
            numbers), series, dicts, xarray's and structured arrays; units in headers and attributes count. Arrays are
            times and displacements as a tuple `(t, x)`, or displacements with `rate=` or `t=`; without units they are
            in seconds and metres.
        **options: for every file and table

            - `column`, `time`: the columns of displacement and time, by name or index (text formats), variable
              (`.npz`, `.mat`: also `"s.signals.values"`, `"cells[0]"`, `"a+b"`) or path (`.h5`: `"/run1/x"`)
            - `run`: which run of a file that holds several, by number or name; "all" for a list of all, be it of one
            - `unit`, `time_unit`: their units where the file names none (default m and s), or the scale of what an
              instrument counts in, as "12.5 um/V"; what contradicts the file is refused
            - `rate`: samples per second, where there are no times
            - `sigma`: standard deviation of the noise, in the unit of the displacement
            - `sign`: -1 reverses the direction
            - `repair`: faults of the instrument that are found and repaired: "dropouts", whose samples are masked,
              and "slips" of a fringe counter, "slips=158.2 nm" with the size of a fringe; both as "dropouts,slips"

            and for text formats `delimiter`, `decimal`, `comment`, `skip_rows`, `header`, `encoding`; for `.mat`
            files `row` and `cells`. Arrays take all of the former but columns, and `t`, the times; records take
            `sigma` and `sign`.

    Returns:
        A `Record` in SI units: metres or radians over seconds; a list of them for `run="all"`. Samples without a value
        are masked and counted in its log.

    Raises:
        DataError: the file is missing, of an unknown format, damaged, or holds no usable record.
        UsageError: an option is unknown to the format or contradicts another, or no record can be made of the source.

    Examples:
        >>> import fricjax as fj
        >>> fj.read(fj.data.example_paths().run)
        Record('synthetic run', 4000 samples, 0..0.7998 s, x in m, 4 steps)
        >>> fj.read({"Time [ms]": [0, 1, 2, 3], "Position [um]": [2000, 1900, 1700, 1400]}).x[0]
        np.float64(0.002)
        >>> fj.read([2.0, 1.9, 1.7, 1.4], rate=5000.0, unit="mm").rate
        5000.0
    """
    options = dict(options)
    repairs = options.pop(_REPAIR, None)
    content = _content(source, options)
    if repairs is None:
        return content
    from .repair import repair

    return [repair(each, repairs) for each in content] if isinstance(content, list) else repair(content, repairs)


def _content(source: Any, options: dict[str, Any]) -> Any:
    """The record of a source as it is, or the records of its runs."""
    if isinstance(source, str | os.PathLike):
        source = Path(source)
        check_file(source)
        reader, kind = _reader(source), f"{source.suffix} files"
    else:
        from .readers.memory import memory_reader

        reader, kind = memory_reader(source)
    parameters = inspect.signature(reader).parameters
    if "choice" not in parameters:
        # A plug-in that knows of no runs has one in each file.
        alone = str(options.get("run")).lower() == "all" and "run" not in parameters
        options = {name: value for name, value in options.items() if not (alone and name == "run")}
        _check_options(reader, kind, options)
        return [reader(source, **options)] if alone else reader(source, **options)
    _check_options(reader, kind, options)
    common = {name: value for name, value in options.items() if name in _COMMON}
    of_format = {name: value for name, value in options.items() if name not in _COMMON}
    choice = Choice(**common)
    content = reader(source, choice, **of_format)
    # A file of the package itself holds one run, and comes back as it was written.
    return content if isinstance(content, list) or not choice.all_runs else [content]


def check(path: Path, options: Collection[str] = ()) -> None:
    """Refuse, before anything large is imported, what `read` would refuse without looking into the file.

    Args:
        path: the file.
        options: names of the options that are to be used.

    Raises:
        DataError: no such file, one that is empty, or of an unknown format.
        UsageError: an option that is unknown to the format.
    """
    check_file(path)
    if path.suffix.lower() not in READERS or options:
        _check_options(_reader(path), f"{path.suffix} files", options)


def _reader(path: Path) -> "Callable[..., Record]":
    suffix = path.suffix.lower()
    if suffix in READERS:
        module, name = READERS[suffix]
        return getattr(importlib.import_module(f".readers.{module}", __package__), name)
    from . import plugins

    reader = plugins.reader_of(path)
    if reader is not None:
        return reader
    known = ", ".join(dict.fromkeys((*READERS, *plugins.suffixes())))
    got = f"the suffix '{path.suffix}'" if path.suffix else "no suffix"
    raise DataError(f"{path.name} is of an unknown format: it has {got}, and known are {known}. Export it as .csv.")


def _check_options(reader: "Callable[..., Any]", kind: str, options: Collection[str]) -> None:
    parameters = inspect.signature(reader).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    common = _COMMON if "choice" in parameters else ()
    of_format = [name for name, parameter in parameters.items() if parameter.kind is parameter.KEYWORD_ONLY]
    known = [f"{name}=" for name in (*common, *of_format)]
    known.append(f"{_REPAIR}=")
    for name in options:
        if f"{name}=" not in known:
            raise UsageError(
                f"{name}= is no option for {kind}.{nearest(f'{name}=', known)} Options are {', '.join(known)}."
            )


class ExamplePaths(NamedTuple):
    """Where the example lies: `run` for `fricjax.read`, `rig` for `fricjax.Rig.from_toml`."""

    run: Path
    rig: Path


def example_paths() -> ExamplePaths:
    """Paths of the example's record and of its rig file.

    Examples:
        >>> import fricjax as fj
        >>> run, rig = fj.data.example_paths()
        >>> run.name, rig.name, fj.read(run).trace.n
        ('run.csv', 'rig.toml', 4000)
    """
    folder = Path(__file__).parent / "example"
    return ExamplePaths(folder / "run.csv", folder / "rig.toml")
