"""Archives of numpy arrays, read without ever unpickling an object."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...errors import DataError, quoted
from ..assemble import records_of
from ..choice import Choice
from ..native import MARK, check_schema, decode
from ..record import Record
from ..sheet import Column, Sheet, array_columns, signal
from .archive import load_arrays


def read_npz(path: Path, choice: Choice) -> Record | list[Record]:
    """Reads two arrays of an `.npz` archive, or a record that `fricjax.write` put there.

    The options are those of `fricjax.read`; units may stand in the names, as in `x_mm`.
    """
    arrays = load_arrays(path)
    if MARK in arrays and choice.takes_all:
        check_schema(arrays[MARK], path.name)
        texts = {name: str(arrays.get(name, "")) for name in ("meta", "log")}
        return choice.applied(decode(arrays, texts, path.name))
    vectors = {name: array for name, array in arrays.items() if array.ndim and name != "mask"}
    if not vectors:
        raise DataError(f"{path.name} holds no arrays of numbers (only {quoted(list(arrays)) or 'nothing'}).")
    columns = [part for name, array in vectors.items() for part in array_columns(name, array.dtype, array.shape, name)]

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [signal(vectors[name], index) for name, index in (column.key for column in wanted)]

    return records_of(path, "npz", Sheet(columns, load), choice, vars(choice))
