"""Records in HDF5 and netCDF-4 files: data sets by path, units from the `units` attribute of the CF conventions."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import records_of
from ..choice import Choice
from ..errors import DataError
from ..native import MARK, check_schema, decode
from ..record import Record
from ..sheet import Column, Sheet, array_columns, signal


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
    run: str | int | None = None,
) -> Record | list[Record]:
    """Reads two data sets of an HDF5 or netCDF-4 file, or a record that `fricjax.write` put there.

    Options as in `fricjax.read`, where

    - `column`: path of the displacement, such as `"/run1/x"`.
    - `time`: path of the times; by default the dimension scale of the displacement, or a data set beside it called so.
    - `unit`, `time_unit`: by default from the attribute `units`, else from the name.
    - `run`: which group, where several hold a time of their own.

    Raises:
        DataError: not such a file, an unknown path (the nearest is offered), a data set that is no vector of numbers.
    """
    import h5py

    choice = Choice(column, time, unit, time_unit, rate, sigma, sign, run)
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
        return records_of(path, "hdf5", _sheet(file, path.name), choice, vars(choice))


def _restore(file: Any, source: str) -> Record:
    check_schema(file.attrs[MARK], source)
    arrays = {name: np.asarray(node[()]) for name, node in file.items()}
    return decode(arrays, {name: str(file.attrs.get(name, "")) for name in ("meta", "log")}, source)


def _sheet(file: Any, source: str) -> Sheet:
    """The data sets as columns; where several groups hold a time of their own, each group is a run."""
    nodes = _data_sets(file)
    if not nodes:
        raise DataError(f"{source} holds no data set of numbers that could be a record.")
    columns: dict[str, list[Column]] = {}
    for path, node in nodes.items():
        folder, name = f"{_folder(path)}/", path.rsplit("/", 1)[1]
        unit = _unit(node)
        parts = array_columns(name, node.dtype, node.shape, path, folder)
        columns[path] = [dataclasses.replace(part, unit=unit or part.unit) for part in parts]
    timed = dict.fromkeys(_folder(path) for path, parts in columns.items() if parts[0].is_time)
    runs = {folder: folder.strip("/") or "/" for folder in timed} if len(timed) > 1 else {}

    def complete(path: str, part: Column) -> Column:
        scales = nodes[path].dims[0]
        scale = scales[0].name if len(scales) else None
        time = columns[scale][0] if scale in columns and scale != path else None
        return dataclasses.replace(part, run=runs.get(_folder(path), part.run), time=time)

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [signal(_values(nodes[path]), index) for path, index in (column.key for column in wanted)]

    return Sheet([complete(path, part) for path, parts in columns.items() for part in parts], load)


def _data_sets(file: Any) -> dict[str, Any]:
    import h5py

    found: dict[str, Any] = {}

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.ndim >= 1:
            found[f"/{name}"] = node

    file.visititems(visit)
    return found


def _folder(path: str) -> str:
    return path.rsplit("/", 1)[0]


def _unit(node: Any) -> str | None:
    text = node.attrs.get("units")
    if isinstance(text, np.ndarray):
        text = text.ravel()[0] if text.size else None
    text = text.decode() if isinstance(text, bytes) else text
    # "seconds since 2020-01-01" counts seconds
    return str(text).split(" since ")[0].strip() or None if text is not None else None


def _values(node: Any) -> np.ndarray:
    """The numbers with CF's missing values, scale and offset applied."""
    raw = np.asarray(node[()])
    values = raw.astype(np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in node.attrs:
            values[raw == np.ravel(node.attrs[name])[0]] = np.nan
    scale, offset = (
        float(np.ravel(node.attrs.get(name, default))[0]) for name, default in (("scale_factor", 1), ("add_offset", 0))
    )
    return values * scale + offset
