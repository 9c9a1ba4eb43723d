"""Records in HDF5 and netCDF-4 files: data sets by path, units from the `units` attribute of the CF conventions."""

from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import Choice, Columns, assemble
from ..choose import displacement_index, time_index
from ..errors import DataError, nearest
from ..native import MARK, check_schema, decode
from ..record import Record


def read_hdf5(
    path: Path,
    *,
    column: str | None = None,
    time: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    rate: float | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Reads two data sets of an HDF5 or netCDF-4 file, or a record that `fricjax.write` put there.

    Options as in `fricjax.read`, where

    - `column`: path of the displacement, such as `"/run1/x"`.
    - `time`: path of the times; by default the dimension scale of the displacement, or a data set beside it called so.
    - `unit`, `time_unit`: by default from the attribute `units`.

    Raises:
        DataError: not such a file, an unknown path (the nearest is offered), a data set that is no vector of numbers.
    """
    import h5py

    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        hint = "; netCDF-3 files must be converted to netCDF-4" if path.suffix.lower() == ".nc" else ""
        raise DataError(
            f"{path.name} cannot be read as HDF5 (it is damaged or of another format{hint}): {error}."
        ) from error
    with file:
        if MARK in file.attrs and choice.takes_all:
            return choice.applied(_restore(file, path.name))
        columns = _columns(file, choice, path.name)
    return assemble(path, "hdf5", columns, choice, vars(choice))


def _restore(file: Any, source: str) -> Record:
    check_schema(file.attrs[MARK], source)
    arrays = {name: np.asarray(node[()]) for name, node in file.items()}
    return decode(arrays, {name: str(file.attrs.get(name, "")) for name in ("meta", "log")}, source)


def _columns(file: Any, choice: Choice, source: str) -> Columns:
    paths = _vectors(file)
    if not paths:
        raise DataError(f"{source} holds no data set of numbers that could be a record.")
    if choice.column is None:
        x_path = _guess(paths, choice, source)
    else:
        x_path = _known(choice.column, paths, source, "column")
    t_path = None if choice.rate is not None else _time_path(file, x_path, paths, choice, source)
    x, x_unit = _values(file[x_path], x_path, source)
    if t_path is None:
        return Columns(x, None, x_path, x_unit=x_unit)
    t, t_unit = _values(file[t_path], t_path, source)
    return Columns(x, t, x_path, t_path, x_unit, t_unit)


def _vectors(file: Any) -> list[str]:
    import h5py

    found: list[str] = []

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "fiu" and node.ndim >= 1:
            found.append(f"/{name}")

    file.visititems(visit)
    return found


def _known(wanted: str, paths: list[str], source: str, what: str) -> str:
    full = str(wanted) if str(wanted).startswith("/") else f"/{wanted}"
    if full not in paths:
        known = ", ".join(f"'{path}'" for path in paths)
        raise DataError(f"{source} has no data set '{wanted}' ({what}=).{nearest(full, paths)} It has {known}.")
    return full


def _last(path: str) -> str:
    return path.rsplit("/", 1)[-1]


def _guess(paths: list[str], choice: Choice, source: str) -> str:
    given = None if choice.time is None else _known(choice.time, paths, source, "time")
    rest = [path for path in paths if path != given]
    t = time_index([_last(path) for path in rest], [None] * len(rest)) if given is None else None
    candidates = [i for i in range(len(rest)) if i != t] or [0]
    names = [_last(path) for path in rest]
    usual = displacement_index(names, candidates, source)
    same = [i for i in candidates if names[i] == names[usual]]
    if len(same) > 1:
        raise DataError(
            f"{source} holds several '{names[usual]}' ({', '.join(rest[i] for i in same)}); name one with column=."
        )
    return rest[usual]


def _time_path(file: Any, x_path: str, paths: list[str], choice: Choice, source: str) -> str | None:
    if choice.time is not None:
        return _known(choice.time, paths, source, "time")
    scales = file[x_path].dims[0]
    if len(scales):
        return scales[0].name
    folder = x_path.rsplit("/", 1)[0]
    beside = [path for path in paths if path.rsplit("/", 1)[0] == folder and path != x_path]
    index = time_index([_last(path) for path in beside], [_unit(file[path]) for path in beside])
    return None if index is None else beside[index]


def _unit(node: Any) -> str | None:
    text = node.attrs.get("units")
    if isinstance(text, np.ndarray):
        text = text.ravel()[0] if text.size else None
    text = text.decode() if isinstance(text, bytes) else text
    # "seconds since 2020-01-01" counts seconds
    return str(text).split(" since ")[0].strip() or None if text is not None else None


def _values(node: Any, path: str, source: str) -> tuple[np.ndarray, str | None]:
    """A vector with CF's missing values, scale and offset applied, and its unit."""
    raw = np.squeeze(np.asarray(node[()]))
    if raw.ndim != 1:
        raise DataError(f"'{path}' in {source} has shape {node.shape}, but a trace needs one dimension.")
    values = raw.astype(np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in node.attrs:
            values[raw == np.ravel(node.attrs[name])[0]] = np.nan
    scale, offset = (
        float(np.ravel(node.attrs.get(name, default))[0]) for name, default in (("scale_factor", 1), ("add_offset", 0))
    )
    return values * scale + offset, _unit(node)
