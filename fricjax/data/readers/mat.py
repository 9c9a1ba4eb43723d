"""Records in MATLAB files: named variables, fields of structs, Simulink's "structure with time", cells in a row."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import Choice, Columns, assemble
from ..choose import displacement_index, time_index
from ..errors import DataError, UsageError, nearest
from ..record import Record
from .matlab import load_tree

PART = re.compile(r"^(?P<name>[^\[\]]+)(?P<indices>(\[\d+\])*)$")


def read_mat(
    path: Path,
    *,
    column: str | list[str] | None = None,
    time: str | list[str] | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    rate: float | None = None,
    sigma: Any = None,
    sign: int = 1,
    row: int = 0,
    cells: list[int] | None = None,
) -> Record:
    """Reads a record from a `.mat` file of version 5 or 7.3.

    Options as in `fricjax.read`, where

    - `column`: the displacement: a variable (`"x"`), a field (`"run.signals.values"`), a Simulink structure with time
      (`"Theta1"` alone brings its time along), a cell array (`"Y"`: its cells one after the other; `"Y[0]"`: one), or
      several of these in a row (`"Y_id+Y_vad"`, or a list).
    - `time`: the times, in the same way.
    - `row`: which signal of a variable that holds several, from 0.
    - `cells`: indices of the cells to take, None for all.

    Raises:
        DataError: damaged file, unknown name (the nearest is offered), or a variable that holds no numbers.
    """
    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    tree = load_tree(path)
    x_names, t_names = _named(column), _named(time)
    if not x_names:
        x_names, t_names = _guess(tree, t_names, rate, path.name)
    nodes = [_find(tree, name, path.name, "column") for name in x_names]
    x = _joined(nodes, x_names, "values", row, cells, path.name)
    if t_names:
        found = [_find(tree, name, path.name, "time") for name in t_names]
        t = _joined(found, t_names, "time", 0, cells, path.name)
    elif rate is None and all(_carries_time(node) for node in nodes):
        t, t_names = _joined(nodes, x_names, "time", 0, cells, path.name), [f"{name}.time" for name in x_names]
    elif rate is None:
        t, t_names = _usual_time(tree, path.name)
    else:
        t = None
    columns = Columns(x, t, "+".join(x_names), "+".join(t_names) or "time")
    return assemble(path, "mat", columns, choice, {**vars(choice), "row": row or None, "cells": cells})


def _named(given: str | list[str] | tuple[str, ...] | None) -> list[str]:
    if given is None:
        return []
    names = given.split("+") if isinstance(given, str) else list(given)
    if not all(isinstance(name, str) and name.strip() for name in names):
        raise UsageError(f"Variables of a .mat file are chosen by name, but {given!r} was given.")
    return [name.strip() for name in names]


def _find(tree: dict[str, Any], name: str, source: str, what: str) -> Any:
    """The node that a dotted path such as `a.b[0].c` names."""
    node: Any = tree
    for part in name.split("."):
        match = PART.match(part)
        if match is None:
            raise UsageError(f"{what}='{name}' is no path of variable, fields and indices such as 'run.x' or 'Y[0]'.")
        if not isinstance(node, dict) or match["name"] not in node:
            names = list(node) if isinstance(node, dict) else []
            known = ", ".join(f"'{key}'" for key in names) or "no fields"
            raise DataError(f"{source} has no '{name}' ({what}=).{nearest(match['name'], names)} There are {known}.")
        node = node[match["name"]]
        for index in re.findall(r"\[(\d+)\]", match["indices"]):
            if not isinstance(node, list) or int(index) >= len(node):
                size = len(node) if isinstance(node, list) else 0
                raise DataError(f"{source}: '{match['name']}' has {size} cells, but {what}= asks for [{index}].")
            node = node[int(index)]
    return node


def _carries_time(node: Any) -> bool:
    return isinstance(node, dict) and "time" in node and "signals" in node and np.size(node["time"]) > 0


def _joined(
    nodes: list[Any], names: list[str], part: str, row: int, cells: list[int] | None, source: str
) -> np.ndarray:
    pieces = [_vector(node, name, part, row, cells, source) for node, name in zip(nodes, names, strict=True)]
    return np.concatenate(pieces)


def _vector(node: Any, name: str, part: str, row: int, cells: list[int] | None, source: str) -> np.ndarray:
    """One signal as a vector: `part` of a Simulink structure, cells one after the other, or a row of an array."""
    if isinstance(node, dict) and part == "time" and "time" in node:
        return _vector(node["time"], f"{name}.time", part, 0, None, source)
    if isinstance(node, dict) and "signals" in node:
        return _vector(node["signals"], f"{name}.signals", part, row, cells, source)
    if isinstance(node, dict) and "values" in node:
        return _vector(node["values"], f"{name}.values", part, row, cells, source)
    if isinstance(node, dict):
        raise DataError(f"'{name}' in {source} is a structure; name one of its fields: {', '.join(node)}.")
    if isinstance(node, list):
        chosen = _chosen(node, name, cells, source)
        return np.concatenate([_vector(cell, f"{name}[{i}]", part, row, None, source) for i, cell in chosen])
    if not isinstance(node, np.ndarray) or node.dtype.kind not in "fiub":
        raise DataError(f"'{name}' in {source} holds no real numbers; name another variable with column=.")
    return _row(np.squeeze(node), name, row, source)


def _chosen(node: list[Any], name: str, cells: list[int] | None, source: str) -> list[tuple[int, Any]]:
    wanted = range(len(node)) if cells is None else cells
    for i in wanted:
        if not 0 <= i < len(node):
            raise DataError(f"'{name}' in {source} has {len(node)} cells, but cells= asks for {i} (the first is 0).")
    return [(i, node[i]) for i in wanted]


def _row(array: np.ndarray, name: str, row: int, source: str) -> np.ndarray:
    """One signal of an array whose longer side is the time."""
    if array.ndim > 2:
        raise DataError(f"'{name}' in {source} has {array.ndim} dimensions, but at most two are expected.")
    signals = np.atleast_2d(array)
    if signals.shape[0] > signals.shape[1]:
        signals = signals.T
    if not 0 <= row < signals.shape[0]:
        raise DataError(
            f"'{name}' in {source} holds {signals.shape[0]} signals, but row={row} was asked for (the first is 0)."
        )
    return signals[row].astype(np.float64)


def _vectors(tree: dict[str, Any]) -> list[str]:
    """Names of the variables at the top that can be a signal."""

    def fits(node: Any) -> bool:
        numbers = isinstance(node, np.ndarray) and node.dtype.kind in "fiu" and node.size >= 2
        return numbers or _carries_time(node) or (isinstance(node, list) and bool(node) and all(map(fits, node)))

    return [name for name, node in tree.items() if fits(node)]


def _guess(tree: dict[str, Any], t_names: list[str], rate: float | None, source: str) -> tuple[list[str], list[str]]:
    names = _vectors(tree)
    if not names:
        raise DataError(f"{source} holds no variable that could be a record; it has {', '.join(tree) or 'nothing'}.")
    t = time_index(names, [None] * len(names))
    candidates = [i for i, name in enumerate(names) if i != t and name not in t_names]
    x = displacement_index(names, candidates or [0], source)
    usual = [names[t]] if t is not None and rate is None and t != x and not _carries_time(tree[names[x]]) else []
    return [names[x]], t_names or usual


def _usual_time(tree: dict[str, Any], source: str) -> tuple[np.ndarray, list[str]]:
    names = _vectors(tree)
    index = time_index(names, [None] * len(names))
    if index is None:
        known = ", ".join(f"'{name}'" for name in tree)
        raise DataError(f"{source} has no variable that is a time by its name; give time= or rate=. There are {known}.")
    return _vector(tree[names[index]], names[index], "time", 0, None, source), [names[index]]
