"""Archives of numpy arrays, read without ever unpickling an object."""

from pathlib import Path
from typing import Any

import numpy as np

from ..assemble import Choice, Columns, assemble
from ..choose import displacement_index, locate, time_index
from ..errors import DataError
from ..native import MARK, check_schema, decode
from ..record import Record
from .archive import load_arrays


def read_npz(
    path: Path,
    *,
    column: str | int | None = None,
    time: str | int | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    rate: float | None = None,
    sigma: Any = None,
    sign: int = 1,
) -> Record:
    """Reads two arrays of an `.npz` archive, or a record that `fricjax.write` put there.

    The options are those of `fricjax.read`.
    """
    choice = Choice(column, time, unit, time_unit, rate, sigma, sign)
    arrays = load_arrays(path)
    if MARK in arrays and choice.takes_all:
        check_schema(arrays[MARK], path.name)
        texts = {name: str(arrays.get(name, "")) for name in ("meta", "log")}
        return choice.applied(decode(arrays, texts, path.name))
    numbers = {
        name: array for name, array in arrays.items() if array.dtype.kind in "fiub" and array.ndim and name != "mask"
    }
    names = list(numbers)
    if not names:
        raise DataError(f"{path.name} holds no arrays of numbers (only {', '.join(arrays) or 'nothing'}).")
    t = _time_index(names, choice, path.name)
    if choice.column is not None:
        x = locate(choice.column, names, path.name, "column")
    else:
        x = displacement_index(names, [i for i in range(len(names)) if i != t] or [0], path.name)
    columns = Columns(
        _vector(numbers, names[x], path), None if t is None else _vector(numbers, names[t], path), names[x]
    )
    if t is not None:
        columns = Columns(columns.x, columns.time, names[x], names[t])
    return assemble(path, "npz", columns, choice, vars(choice))


def _time_index(names: list[str], choice: Choice, source: str) -> int | None:
    if choice.rate is not None:
        return None
    if choice.time is not None:
        return locate(choice.time, names, source, "time")
    return time_index(names, [None] * len(names))


def _vector(numbers: dict[str, np.ndarray], name: str, path: Path) -> np.ndarray:
    array = np.squeeze(numbers[name])
    if array.ndim != 1:
        raise DataError(f"'{name}' in {path.name} has shape {numbers[name].shape}, but a trace needs one dimension.")
    return array.astype(np.float64)
