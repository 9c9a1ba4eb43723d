"""Records in HDF5 and netCDF-4 files: data sets by path, units from the `units` attribute of the CF conventions."""

from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import Choice, Columns, assemble
from ..choose import displacement_index, time_index
from ..errors import DataError, brief, nearest
from ..native import COLUMNS, MARK, check_schema, decode
from ..record import Record
from .nodes import Tree, opened


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
    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    hint = "it is damaged or of another format"
    if path.suffix.lower() == ".nc":
        hint += "; netCDF-3 files must be converted to netCDF-4"
    with opened(path, hint=hint) as tree:
        mark = tree.attribute(tree.file, MARK)
        if mark is not None and choice.takes_all:
            return choice.applied(_restore(tree, mark))
        columns = _columns(tree, choice, path.name)
    return assemble(path, "hdf5", columns, choice, vars(choice))


def _restore(tree: Tree, mark: Any) -> Record:
    check_schema(mark, tree.path.name)
    nodes = tree.data_sets()
    arrays = {name: tree.read(nodes[f"/{name}"]) for name in COLUMNS if f"/{name}" in nodes}
    texts = {name: str(tree.attribute(tree.file, name, "")) for name in ("meta", "log")}
    return decode(arrays, texts, tree.path.name)


def _columns(tree: Tree, choice: Choice, source: str) -> Columns:
    nodes = {path: node for path, node in tree.data_sets().items() if _fits(node)}
    paths = list(nodes)
    if not paths:
        raise DataError(f"{source} holds no data set of numbers that could be a record.")
    if choice.column is None:
        x_path = _guess(paths, choice, source)
    else:
        x_path = _known(choice.column, paths, source, "column")
    t_path = None if choice.rate is not None else _time_path(tree, x_path, nodes, choice, source)
    x, x_unit = _values(tree, nodes[x_path], x_path)
    if t_path is None:
        return Columns(x, None, x_path, x_unit=x_unit)
    t, t_unit = _values(tree, nodes[t_path], t_path)
    return Columns(x, t, x_path, t_path, x_unit, t_unit)


def _fits(node: Any) -> bool:
    """Whether a data set can be a signal; one of a type that numpy does not know cannot."""
    try:
        return node.dtype.kind in "fiu" and node.ndim >= 1
    except TypeError:
        return False


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


def _time_path(tree: Tree, x_path: str, nodes: dict[str, Any], choice: Choice, source: str) -> str | None:
    if choice.time is not None:
        return _known(choice.time, list(nodes), source, "time")
    scale = tree.scale(nodes[x_path])
    if scale in nodes:
        return scale
    folder = x_path.rsplit("/", 1)[0]
    beside = [path for path in nodes if path.rsplit("/", 1)[0] == folder and path != x_path]
    index = time_index([_last(path) for path in beside], [_unit(tree, nodes[path]) for path in beside])
    return None if index is None else beside[index]


def _unit(tree: Tree, node: Any) -> str | None:
    text = tree.attribute(node, "units")
    # "seconds since 2020-01-01" counts seconds
    return str(text).split(" since ")[0].strip() or None if text is not None else None


def _values(tree: Tree, node: Any, path: str) -> tuple[np.ndarray, str | None]:
    """A vector with CF's missing values, scale and offset applied, and its unit."""
    raw = np.squeeze(tree.read(node))
    if raw.ndim != 1:
        raise DataError(f"'{path}' in {tree.path.name} has shape {node.shape}, but a trace needs one dimension.")
    values = raw.astype(np.float64)
    for name in ("_FillValue", "missing_value"):
        missing = tree.attribute(node, name)
        if missing is not None:
            values[raw == missing] = np.nan
    scale, offset = _number(tree, node, "scale_factor", 1.0), _number(tree, node, "add_offset", 0.0)
    return values * scale + offset, _unit(tree, node)


def _number(tree: Tree, node: Any, name: str, default: float) -> float:
    given = tree.attribute(node, name, default)
    try:
        return float(given)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"The attribute {name} of '{node.name}' in {tree.path.name} is {brief(given)}, no number."
        ) from error
