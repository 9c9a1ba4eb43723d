"""Records in archives of numpy arrays, without pickled objects."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError, quoted
from ..native import COLUMNS, MARK
from .choice import Choice
from .header import names_rate
from .sheet import Column, Sheet, array_columns, fault_of, signal


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open an `.npz` archive, also one from `fricjax.write`.

    Names may contain units, as in `x_mm`.
    """
    archive = np.load(path)
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise DataError(f"{path.name} is a single array, not an archive of named arrays; write it with numpy.savez.")
    with archive:
        arrays = dict(_arrays(path, archive))
        if choice.takes_all and MARK in arrays:
            yield fricjax_sheet(arrays, {name: str(arrays.get(name, "")) for name in (MARK, "meta", "log")})
            return
        vectors = {name: array for name, array in arrays.items() if (array.ndim or names_rate(name)) and name != "mask"}
        if not vectors:
            raise DataError(f"{path.name} holds no arrays of numbers (only {quoted(list(arrays)) or 'nothing'}).")
        columns = [
            column for name, each in vectors.items() for column in array_columns(name, each.dtype, each.shape, name)
        ]
        load = lambda wanted: [signal(vectors[name], index) for name, index in (column.key for column in wanted)]
        yield Sheet(columns, load)


def _arrays(path: Path, archive: Any) -> Iterator[tuple[str, np.ndarray]]:
    names = [name for name in archive.zip.namelist() if name.endswith(".npy")]
    for name in names:
        if names.count(name) > 1:
            raise DataError(f"{path.name} has several members '{name}'; write it again with unique names.")
        try:
            yield name.removesuffix(".npy"), archive[name]
        except ValueError as error:
            if "allow_pickle" not in str(error):
                raise
            raise DataError(
                f"{path.name}: '{name}' holds pickled objects, which are refused; write numbers."
            ) from error


def fricjax_sheet(arrays: dict[str, Any], texts: dict[str, str]) -> Sheet:
    """Return the sheet of a record in the package's own format.

    `arrays` are numpy arrays or data sets by name.
    """
    columns = [
        Column(name, fault=fault_of(arrays[name].dtype, arrays[name].shape), key=name)
        for name in COLUMNS
        if name in arrays
    ]
    load = lambda wanted: [np.asarray(arrays[column.key], dtype=np.float64) for column in wanted]
    return Sheet(columns, load, record=texts)
