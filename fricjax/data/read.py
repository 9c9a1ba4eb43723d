"""One entry point for all sources of records.

`read` selects the reader by file suffix or object type. Other packages add formats through the entry point group
`fricjax.readers`. The name of the entry point is the suffix without its dot. The object is a function `(path, choice,
**options)` that returns a record, or a list for all runs.

The package contains an example, a synthetic run. A magnet holds a mass of 0.41 kg on leaf springs (12.6 Hz) at 2 mm,
under a load of 9.66 N, with mu = 0.02. After the release the mass comes to rest within 13 half-cycles. The sample rate
is 5 kHz and the noise 5 nm. `meta["coefficients"]` of the record holds the true values.
"""

import dataclasses
import functools
import inspect
import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from ..errors import DataError, UsageError, brief, nearest
from .files import check_file
from .reader_process import Format, read_content
from .readers.choice import Choice

if TYPE_CHECKING:
    from .record import Record

_TEXTS = (".csv", ".txt", ".dat", ".tsv", ".asc", ".lvm", ".log", ".prn", ".tab")
_HDF5, _MATLAB = Format("hdf5", "HDF5", "hdf5"), Format("mat", "a MATLAB file", "mat", options=("row", "cells"))
_EXCEL = Format("excel", ".xlsx", "xlsx", ("openpyxl", "excel"), ("skip_rows", "header"))
_PARQUET = Format("parquet", "Parquet", "parquet", ("pyarrow.parquet", "parquet"))
_UFF = Format("uff", "a universal file", "uff", ("pyuff", "uff"))
_MDF = Format("mdf", "MDF", "mdf", ("asammdf", "mdf"))
FORMATS = {
    ".npz": Format("npz", ".npz", "npz"),
    ".mat": _MATLAB,
    ".xlsx": _EXCEL,
    ".xlsm": _EXCEL,
    ".h5": _HDF5,
    ".hdf5": _HDF5,
    ".nc": Format("netcdf", "netCDF", "netcdf"),
    ".tdms": Format("tdms", "TDMS", "tdms", ("nptdms", "tdms")),
    ".parquet": _PARQUET,
    ".pq": _PARQUET,
    ".uff": _UFF,
    ".unv": _UFF,
    ".mf4": _MDF,
    ".mdf": _MDF,
}
"""Binary formats by suffix."""
SUFFIXES = (*_TEXTS, *FORMATS)
"""Suffixes of the formats that this package reads."""
# Options of all files and tables.
_COMMON = tuple(field.name for field in dataclasses.fields(Choice))
# Options that are applied to the record, for all sources.
_AFTER = ("crop", "repair")


@overload
def read(source: Any, *, run: Literal["all"], **options: Any) -> "list[Record]": ...
@overload
def read(source: Any, **options: Any) -> "Record": ...
def read(source: Any, **options: Any) -> Any:
    """Read a displacement record from a file or an object in memory.

    Args:
        source: a path, a table, arrays, a trace or a record. Supported files: text (`.csv`, `.txt`, `.dat`, `.tsv`,
            `.asc`, `.lvm`, `.log`, `.prn`, `.tab`), `.npz`, `.mat`, `.h5`, `.hdf5` and `.nc`; with optional
            dependencies `.xlsx`, `.tdms`, `.parquet`, `.uff`, `.unv` and `.mf4`; and the formats of installed plug-ins.
            Supported tables: pandas and polars tables, series, dicts, xarray and structured arrays. The index of a
            table is the time if its name says so, or if it holds dates, durations or decimal numbers. Units in headers
            and attributes are used. Arrays are a tuple `(t, x)`, or displacements with `rate=` or `t=`; without units
            they are in seconds and metres.
        **options: for all files and tables

            - `column`, `time`: the columns of displacement and time, by name or index (text formats), variable
              (`.npz`, `.mat`: also `"s.signals.values"`, `"cells[0]"`, `"a+b"`) or path (`.h5`: `"/run1/x"`)
            - `run`: number or name of the run in a file with several; "all" returns a list of all runs
            - `unit`, `time_unit`: the units if the file has none (default m and s), or the scale of the raw values,
              such as "12.5 um/V"; a unit that contradicts the file is refused. With a unit of velocity or acceleration
              (rad/s, deg/s, m/s, m/s^2, g) the record is one: see `fricjax.Observation`
            - `pendulum_length`: length of a pendulum that was filmed from the front, such as 0.42 or "0.42 m"; the
              column is then its horizontal position ``L sin(theta)``
            - `rate`: samples per second, if there are no times
            - `sigma`: standard deviation of the noise, in the unit of the displacement
            - `sign`: -1 reverses the direction
            - `crop`: first and last time to keep [s], such as (0.1, 2.0) or (None, 2.0)
            - `repair`: instrument faults to detect and repair: "dropouts" masks the affected samples, "clock" shifts
              samples to their right times and removes repeated ones, "slips" removes slips of a fringe counter,
              "slips=158.2 nm" with the fringe size; combine as "dropouts,clock,slips"

            Text formats also take `delimiter`, `decimal`, `comment`, `skip_rows`, `header` and `encoding`; `.mat`
            files take `row` and `cells`. Arrays take all common options except the columns, and `t`, the times.
            Records take `sigma` and `sign`.

    Returns:
        A `Record` in SI units; a list of records for `run="all"`. Samples without a value
        are masked and counted in the log.

    Raises:
        DataError: the file is missing, damaged or of an unknown format, or holds no usable record.
        UsageError: an option is unknown to the format or contradicts another, or the source is of an unsupported type.

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
    span, repairs = (options.pop(name, None) for name in _AFTER)
    if span is not None and not (isinstance(span, tuple | list) and len(span) == 2):
        raise UsageError(f"crop must be a pair of times in s, such as (0.1, 2.0), but it is {brief(span)}.")
    content = _content(source, options)

    def changed(record: "Record") -> "Record":
        if span is not None:
            from .preprocess import crop

            record = crop(record, *span)
        if repairs is not None:
            from .repair import repair

            record = repair(record, repairs)
        return record

    return list(map(changed, content)) if isinstance(content, list) else changed(content)


def _content(source: Any, options: dict[str, Any]) -> Any:
    """Return the record of a source, or a list for all runs."""
    if isinstance(source, str | os.PathLike):
        source = Path(source)
        check_file(source)
        reader, kind = _reader(source), f"{source.suffix} files"
    else:
        from .readers.memory import memory_reader

        function, kind = memory_reader(source)
        reader = _Reader.of(function)
    alone = not reader.takes_choice and str(options.get("run")).lower() == "all" and "run" not in reader.options
    if alone:
        # A plug-in without the option run= reads one run per file.
        del options["run"]
    reader.check(kind, options)
    if not reader.takes_choice:
        content = reader.function(source, **options)
        return [content] if alone else content
    common = {name: value for name, value in options.items() if name in _COMMON}
    of_format = {name: value for name, value in options.items() if name not in _COMMON}
    choice = Choice(**common)
    content = reader.function(source, choice, **of_format)
    # A file in the package's own format holds one run and is restored as it was written.
    return content if isinstance(content, list) or not choice.all_runs else [content]


def check(path: Path, options: Collection[str] = ()) -> None:
    """Refuse an unusable path or option before large imports.

    This makes the checks of `read` that do not need the content of the file. `options` are the names of those to use.

    Raises:
        DataError: the file is missing, empty or of an unknown format.
        UsageError: an option is unknown to the format.
    """
    check_file(path)
    if path.suffix.lower() not in SUFFIXES or options:
        _reader(path).check(f"{path.suffix} files", options)


class _Reader(NamedTuple):
    """A function that reads a source, with its options.

    `takes_any` is True for a plug-in that checks its options itself.
    """

    function: Callable[..., Any]
    options: tuple[str, ...]
    takes_choice: bool = True
    takes_any: bool = False

    @classmethod
    @functools.cache
    def of(cls, function: Callable[..., Any]) -> "_Reader":
        """Return the reader of a function with its options as keywords."""
        parameters = inspect.signature(function).parameters
        options = [name for name, parameter in parameters.items() if parameter.kind is parameter.KEYWORD_ONLY]
        takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
        return cls(function, tuple(options), "choice" in parameters, takes_any)

    def check(self, kind: str, options: Collection[str]) -> None:
        """Refuse unknown options; messages name the `kind` of source."""
        common = _COMMON if self.takes_choice else ()
        known = [f"{name}=" for name in (*common, *self.options, *_AFTER)]
        for name in () if self.takes_any else options:
            if f"{name}=" not in known:
                raise UsageError(
                    f"{name}= is no option for {kind}.{nearest(f'{name}=', known)} Options are {', '.join(known)}."
                )


def _reader(path: Path) -> _Reader:
    suffix = path.suffix.lower()
    if suffix in _TEXTS:
        from .readers.csv import read_csv

        return _Reader.of(read_csv)
    if suffix in FORMATS:
        file_format = FORMATS[suffix]
        return _Reader(functools.partial(_read_binary, file_format), file_format.options)
    from . import plugins

    reader = plugins.reader_of(path)
    if reader is not None:
        return _Reader.of(reader)
    known = ", ".join(dict.fromkeys((*SUFFIXES, *plugins.suffixes())))
    got = f"the suffix '{path.suffix}'" if path.suffix else "no suffix"
    raise DataError(f"{path.name} is of an unknown format: it has {got}, and known are {known}. Export it as .csv.")


def _read_binary(file_format: Format, path: Path, choice: Choice, **options: Any) -> "Record | list[Record]":
    from .native import restored
    from .readers.assemble import assemble_all, with_choice

    runs, record = read_content(path, file_format, choice, options)
    if record is not None:
        return with_choice(restored(*record, path.name), choice)
    return assemble_all(path, file_format.name, runs, choice, **options)


class ExamplePaths(NamedTuple):
    """Paths of the example: `run` for `fricjax.read`, `rig` for `fricjax.Rig.from_toml`."""

    run: Path
    rig: Path


def example_paths() -> ExamplePaths:
    """Return the paths of the example record and its rig file.

    Examples:
        >>> import fricjax as fj
        >>> run, rig = fj.data.example_paths()
        >>> run.name, rig.name, fj.read(run).trace.n
        ('run.csv', 'rig.toml', 4000)
    """
    folder = Path(__file__).parent / "example"
    return ExamplePaths(folder / "run.csv", folder / "rig.toml")
