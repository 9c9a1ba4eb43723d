"""Records in HDF5 and netCDF-4 files, with units by the CF conventions."""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError, brief
from ..native import COLUMNS, MARK, check_schema, decode
from ..record import Record
from .assemble import records_of, with_choice
from .choice import Choice
from .header import names_rate
from .nodes import Tree, opened
from .sheet import Column, Sheet, array_columns, signal


def read_hdf5(path: Path, choice: Choice) -> Record | list[Record]:
    """Read two data sets of an HDF5 or netCDF-4 file.

    A record that `fricjax.write` stored is restored.

    Options as in `fricjax.read`, with

    - `column`: path of the displacement, such as `"/run1/x"`.
    - `time`: path of the times; by default the dimension scale of the displacement, or a data set in the same group
      with the name of a time.
    - `unit`, `time_unit`: by default from the attribute `units`, else from the name.
    - `run`: the group, if several groups hold a separate time.

    Raises:
        DataError: not such a file, an unknown path (the message offers the nearest), or a data set that is not a vector
            of numbers.
    """
    with opened(path) as tree:
        mark = tree.attribute(tree.file, MARK)
        if mark is not None and choice.takes_all:
            return with_choice(_restore(tree, mark), choice)
        return records_of(path, "hdf5", _sheet(tree), choice)


def _restore(tree: Tree, mark: Any) -> Record:
    check_schema(mark, tree.path.name)
    nodes = tree.data_sets()
    arrays = {name: tree.read(nodes[f"/{name}"]) for name in COLUMNS if f"/{name}" in nodes}
    texts = {name: str(tree.attribute(tree.file, name, "")) for name in ("meta", "log")}
    return decode(arrays, texts, tree.path.name)


def _sheet(tree: Tree) -> Sheet:
    """Return the data sets as columns.

    If several groups hold a separate time, each group is a run.
    """
    nodes = {path: node for path, node in tree.data_sets().items() if node.ndim or names_rate(path)}
    columns = {path: _columns(tree, path, node) for path, node in nodes.items()}
    timed = dict.fromkeys(_folder(path) for path, parts in columns.items() if parts[0].is_time)
    runs = {folder: folder.strip("/") or "/" for folder in timed} if len(timed) > 1 else {}

    def complete(path: str, part: Column) -> Column:
        scale = tree.scale(nodes[path])
        time = columns[scale][0] if scale in columns and scale != path else None
        return dataclasses.replace(part, run=runs.get(_folder(path), part.run), time=time)

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [signal(_values(tree, nodes[path]), index) for path, index in (column.key for column in wanted)]

    return Sheet([complete(path, part) for path, parts in columns.items() for part in parts], load, of="data set")


def _columns(tree: Tree, path: str, node: Any) -> list[Column]:
    name = path.rsplit("/", 1)[1]
    unit = cf_unit(tree.attribute(node, "units"))
    try:
        return array_columns(name, node.dtype, node.shape, path, folder=f"{_folder(path)}/", unit=unit)
    except TypeError:  # a type of numbers that numpy does not know
        return [Column(path, title=path, fault="holds no numbers", key=(path, 0))]


def _folder(path: str) -> str:
    return path.rsplit("/", 1)[0]


def _values(tree: Tree, node: Any) -> np.ndarray:
    where = f"'{node.name}' in {tree.path.name}"
    return cf_values(np.asarray(tree.read(node)), functools.partial(tree.attribute, node), where)


def cf_unit(units: Any) -> str | None:
    """Return the unit in a CF attribute; "seconds since ..." gives "seconds"."""
    return None if units is None else str(units).split(" since ")[0].strip() or None


def cf_values(raw: np.ndarray, attribute: Callable[[str], Any], where: str) -> np.ndarray:
    """Apply missing values, scale and offset of the CF conventions.

    Args:
        raw: the stored numbers, of any shape.
        attribute: function from a name to the attribute, None if there is none.
        where: the data, for messages: "'x' in run.nc".

    Raises:
        DataError: a scale or offset that is not a number.
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
