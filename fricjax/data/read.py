"""One entry point for all sources of records.

`read` selects the reader by file suffix or object type. Other packages add formats through the entry point group
`fricjax.readers`. The name of the entry point is the suffix without its dot. The object is a function `(path, choice,
**options)` that returns a record, or a list for all runs.

The package contains an example, a synthetic run. A magnet holds a mass of 0.41 kg on leaf springs (12.6 Hz) at 2 mm,
under a load of 9.66 N, with mu = 0.02. After the release the mass comes to rest within 13 half-cycles. The sample rate
is 5 kHz and the noise 5 nm. `meta["coefficients"]` of the record holds the true values.
"""

import dataclasses
import importlib
import inspect
import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from ..errors import DataError, UsageError, brief, nearest
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
              such as "12.5 um/V"; a unit that contradicts the file is refused
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
        A `Record` in SI units (metres or radians, seconds); a list of records for `run="all"`. Samples without a value
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

        reader, kind = memory_reader(source)
    parameters = inspect.signature(reader).parameters
    if "choice" not in parameters:
        # A plug-in without the option run= reads one run per file.
        alone = str(options.get("run")).lower() == "all" and "run" not in parameters
        options = {name: value for name, value in options.items() if not (alone and name == "run")}
        _check_options(reader, kind, options)
        return [reader(source, **options)] if alone else reader(source, **options)
    _check_options(reader, kind, options)
    common = {name: value for name, value in options.items() if name in _COMMON}
    of_format = {name: value for name, value in options.items() if name not in _COMMON}
    choice = Choice(**common)
    content = reader(source, choice, **of_format)
    # A file in the package's own format holds one run and is restored as it was written.
    return content if isinstance(content, list) or not choice.all_runs else [content]


def check(path: Path, options: Collection[str] = ()) -> None:
    """Refuse an unusable path or option before large imports.

    This makes the checks of `read` that do not need the content of the file.

    Args:
        path: the file.
        options: names of the options to use.

    Raises:
        DataError: the file is missing, empty or of an unknown format.
        UsageError: an option is unknown to the format.
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
    known += [f"{name}=" for name in _AFTER]
    for name in options:
        if f"{name}=" not in known:
            raise UsageError(
                f"{name}= is no option for {kind}.{nearest(f'{name}=', known)} Options are {', '.join(known)}."
            )


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
