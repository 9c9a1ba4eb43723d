"""Records in MATLAB files: variables, struct fields, Simulink structures, cell arrays."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ...errors import DataError, UsageError, nearest, quoted
from .choice import Choice
from .header import Title, names_rate, split_title
from .matlab import Opaque, load_tree, numbers_of
from .nodes import is_hdf5
from .sheet import Column, Sheet, array_columns, folder_of, signal

PART = re.compile(r"^(?P<name>[^\[\]]+)(?P<indices>(\[\d+\])*)$")


@contextmanager
def open_sheet(path: Path, choice: Choice, *, row: int = 0, cells: Sequence[int] | None = None) -> Iterator[Sheet]:
    """Open a `.mat` file of version 4, 5 or 7.3.

    Options as in `fricjax.read`, with

    - `column`: the displacement: a variable (`"x"`), a field (`"run.signals.values"`), a Simulink structure with time
      (`"Theta1"` includes its time), a cell array (`"Y"`: its cells joined; `"Y[0]"`: one cell), or several of these
      joined (`"Y_id+Y_vad"`, or a list).
    - `time`: the times, in the same way.
    - `row`: the signal of a variable with several, from 0.
    - `cells`: indices of the cells to read, None for all.
    - `run`: the structure, if several structures hold a separate time; signals of Simulink have their labels as names.
    """
    with h5py.File(path, "r") if is_hdf5(path) else nullcontext() as file:
        tree = load_tree(path, file)
        columns = _columns(tree)
        for what, wanted in (("column", choice.column), ("time", choice.time)):
            known = any(wanted in (column.name, column.title) for column in columns)
            if isinstance(wanted, str) and not known and re.split(r"[.\[+]", wanted)[0].strip() in tree:
                columns.append(_explicit(tree, wanted, path.name, what))
        if not columns:
            raise DataError(
                f"{path.name} holds no variable that could be a record; it has {quoted(list(tree)) or 'nothing'}."
            )
        yield Sheet(columns, lambda wanted: [_loaded(tree, column, row, cells, path.name) for column in wanted])


def _columns(tree: dict[str, Any]) -> list[Column]:
    """Return all possible signals as columns.

    These are variables, fields, Simulink signals and cell arrays; data of other types have a fault.
    """
    columns = [column for name, node in tree.items() for column in _walk(name, node)]
    folders = {folder_of(column.name) for column in columns if column.is_time}
    runs = folders if len(folders) > 1 and "" not in folders else set()
    return [replace(column, run=folder) if (folder := folder_of(column.name)) in runs else column for column in columns]


def _walk(name: str, node: Any) -> Iterator[Column]:
    if isinstance(node, dict):
        series = _time_series(name, node)
        if series:
            yield from series
            return
        for key, child in node.items():
            yield from _walk(f"{name}.{key}", child)
    elif isinstance(node, list) and node and all(isinstance(cell, dict) for cell in node):
        for i, cell in enumerate(node):
            yield from _walk(f"{name}[{i}]", cell)
    elif isinstance(node, list):
        numbers = bool(node) and all(_is_array(cell) and cell.dtype.kind in "fiu" for cell in node)
        yield Column(name, title=name, fault=None if numbers else "holds cells that are no numbers", key=(name, None))
    elif _is_array(node):
        if node.size != 1 or names_rate(name):
            folder = f"{folder_of(name)}." if folder_of(name) else ""
            yield from array_columns(name.removeprefix(folder), node.dtype, node.shape, name, folder=folder)
    else:
        kind = f"is {node.kind}" if isinstance(node, Opaque) else "holds text"
        yield Column(name, title=name, fault=kind, key=(name, None))


def _is_array(node: Any) -> bool:
    return isinstance(node, np.ndarray | h5py.Dataset)


def _time_series(name: str, node: dict[str, Any]) -> list[Column]:
    """Return the signals of a Simulink structure or an exported timeseries.

    The list is empty for any other structure.
    """
    keys = {key.lower(): key for key in node}
    if "time" not in keys or not {"signals", "data"} & set(keys) or np.size(node[keys["time"]]) == 0:
        return []
    time = Column(f"{name}.{keys['time']}", "s", title=f"{name}.{keys['time']}", key=(f"{name}.{keys['time']}", None))
    if "data" in keys:
        return [time, Column(name, _unit(node), title=name, time=time, key=(f"{name}.{keys['data']}", None))]
    signals = node[keys["signals"]]
    if not isinstance(signals, list):
        return [time, Column(name, title=name, time=time, key=(name, None))]
    columns = [time]
    for i, signal_ in enumerate(signals):
        path = f"{name}.{keys['signals']}[{i}]"
        label = signal_.get("label") if isinstance(signal_, dict) else None
        title = split_title(label) if isinstance(label, str) and label.strip() else Title(path)
        columns.append(Column(title.name, title.unit, title=label or path, time=time, key=(path, None)))
    return columns


def _unit(node: dict[str, Any]) -> str | None:
    """Return the unit of a timeseries."""
    about = next((node[key] for key in node if key.lower() == "datainfo"), node)
    units = next((about[key] for key in about if key.lower() == "units"), None) if isinstance(about, dict) else None
    return units.strip() or None if isinstance(units, str) else None


def _explicit(tree: dict[str, Any], wanted: str, source: str, what: str) -> Column:
    """Return the column for a path, or several joined by "+".

    Structures with time include their time.
    """
    names = [name.strip() for name in wanted.split("+")]
    if not all(names):
        raise UsageError(f"Variables of a .mat file are chosen by name, but {wanted!r} was given.")
    nodes = [_find(tree, name, source, what) for name in names]
    title = "+".join(names)
    timed = all(
        isinstance(node, dict) and "time" in node and "signals" in node and np.size(node["time"]) > 0 for node in nodes
    )
    time = Column(f"{title}.time", "s", key=("+".join(f"{name}.time" for name in names), None)) if timed else None
    return Column(title, title=title, time=time, key=(title, None))


def _loaded(tree: dict[str, Any], column: Column, row: int, cells: Sequence[int] | None, source: str) -> np.ndarray:
    """Load one signal of a matrix, or all parts of a path."""
    path, index = column.key
    names = path.split("+")
    nodes = [_find(tree, name, source, "column") for name in names]
    if index is not None:
        return signal(numbers_of(nodes[0]), index)
    single = row if not column.is_time else 0
    pieces = [_vector(node, name, single, cells, source) for node, name in zip(nodes, names, strict=True)]
    return np.concatenate(pieces)


def _find(tree: dict[str, Any], name: str, source: str, what: str) -> Any:
    """Return the node at a dotted path such as `a.b[0].c`."""
    node: Any = tree
    for part in name.split("."):
        match = PART.match(part)
        if match is None:
            raise UsageError(f"{what}='{name}' is no path of variable, fields and indices such as 'run.x' or 'Y[0]'.")
        if not isinstance(node, dict) or match["name"] not in node:
            names = list(node) if isinstance(node, dict) else []
            known = quoted(names) or "no fields"
            raise DataError(f"{source} has no '{name}' ({what}=).{nearest(match['name'], names)} There are {known}.")
        node = node[match["name"]]
        for index in re.findall(r"\[(\d+)\]", match["indices"]):
            if not isinstance(node, list) or int(index) >= len(node):
                size = len(node) if isinstance(node, list) else 0
                raise DataError(f"{source}: '{match['name']}' has {size} cells, but {what}= asks for [{index}].")
            node = node[int(index)]
    return node


def _vector(node: Any, name: str, row: int, cells: Sequence[int] | None, source: str) -> np.ndarray:
    """Return one signal as a vector.

    It comes from a Simulink structure, joined cells, or a row of an array.
    """
    for part in ("signals", "values"):
        if isinstance(node, dict) and part in node:
            return _vector(node[part], f"{name}.{part}", row, cells, source)
    if isinstance(node, dict):
        raise DataError(f"'{name}' in {source} is a structure; name one of its fields: {quoted(list(node))}.")
    if isinstance(node, list):
        wanted = range(len(node)) if cells is None else cells
        for i in wanted:
            if not 0 <= i < len(node):
                raise DataError(
                    f"'{name}' in {source} has {len(node)} cells, but cells= asks for {i} (the first is 0)."
                )
        return np.concatenate([_vector(node[i], f"{name}[{i}]", row, None, source) for i in wanted])
    if not _is_array(node) or node.dtype.kind not in "fiub":
        raise DataError(f"'{name}' in {source} holds no real numbers; name another variable with column=.")
    array = np.squeeze(numbers_of(node))
    if array.ndim > 2:
        raise DataError(f"'{name}' in {source} has {array.ndim} dimensions, but at most two are expected.")
    # The longer side of a matrix is the time.
    count = min(array.shape) if array.ndim == 2 else 1
    if not 0 <= row < count:
        raise DataError(f"'{name}' in {source} holds {count} signals, but row={row} was given (the first is 0).")
    return signal(array, row)
