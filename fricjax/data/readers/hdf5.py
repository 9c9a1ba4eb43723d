"""Records in HDF5 and netCDF-4 files, with units by the CF conventions."""

import dataclasses
import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ...errors import DataError, brief
from ..native import COLUMNS, MARK
from .choice import Choice
from .header import names_rate
from .nodes import attribute, data_sets, elsewhere, scale
from .npz import fricjax_sheet
from .sheet import Column, Sheet, array_columns, signal


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open an HDF5 or netCDF-4 file, also a record from `fricjax.write`.

    The names of the columns are paths, such as `"/run1/x"`. The times of a column are its dimension scale. The unit is
    that of the attribute `units`, else of the name. If several groups hold a separate time, each group is a run.
    """
    with h5py.File(path, "r") as file:
        nodes = data_sets(file)
        if choice.takes_all and (mark := attribute(file, MARK)) is not None:
            arrays = {name: nodes[f"/{name}"] for name in COLUMNS if f"/{name}" in nodes}
            texts = {name: str(attribute(file, name, "")) for name in ("meta", "log")}
            yield fricjax_sheet(arrays, {MARK: str(mark), **texts})
        else:
            yield _sheet(path, {name: node for name, node in nodes.items() if node.ndim or names_rate(name)})


def _sheet(path: Path, nodes: dict[str, Any]) -> Sheet:
    columns = {name: _columns(name, node) for name, node in nodes.items()}
    timed = dict.fromkeys(_folder(name) for name, parts in columns.items() if parts[0].is_time)
    runs = {folder: folder.strip("/") or "/" for folder in timed} if len(timed) > 1 else {}

    def complete(name: str, part: Column) -> Column:
        coordinate = scale(nodes[name])
        time = columns[coordinate][0] if coordinate in columns and coordinate != name else None
        return dataclasses.replace(part, run=runs.get(_folder(name), part.run), time=time)

    def values(name: str) -> np.ndarray:
        node = nodes[name]
        return cf_values(node[()], functools.partial(attribute, node), f"'{name}' in {path.name}")

    load = lambda wanted: [signal(values(name), index) for name, index in (column.key for column in wanted)]
    return Sheet([complete(name, part) for name, parts in columns.items() for part in parts], load, of="data set")


def _columns(path: str, node: Any) -> list[Column]:
    if elsewhere(node):
        return [Column(path, title=path, fault="lies in another file, which is not opened", key=(path, 0))]
    name = path.rsplit("/", 1)[1]
    unit = cf_unit(attribute(node, "units"))
    try:
        return array_columns(name, node.dtype, node.shape, path, folder=f"{_folder(path)}/", unit=unit)
    except TypeError:  # a type of numbers that numpy does not know
        return [Column(path, title=path, fault="holds no numbers", key=(path, 0))]


def _folder(path: str) -> str:
    return path.rsplit("/", 1)[0]


def cf_unit(units: Any) -> str | None:
    """Return the unit in a CF attribute; "seconds since ..." gives "seconds"."""
    return None if units is None else str(units).split(" since ")[0].strip() or None


def cf_values(raw: np.ndarray, attribute: Callable[[str], Any], where: str) -> np.ndarray:
    """Apply missing values, scale and offset of the CF conventions.

    `attribute` looks up an attribute by its name; `where` names the data in messages: "'x' in run.nc".
    """
    values = raw.astype(np.float64)
    for name in ("_FillValue", "missing_value"):
        missing = attribute(name)
        if missing is not None:
            values[raw == missing] = np.nan
    scale, offset = attribute("scale_factor"), attribute("add_offset")
    try:
        return values * (1.0 if scale is None else float(scale)) + (0.0 if offset is None else float(offset))
    except (TypeError, ValueError) as error:
        stated = " and ".join(brief(each) for each in (scale, offset) if each is not None)
        raise DataError(f"scale_factor or add_offset of {where} is {stated}, no number.") from error
