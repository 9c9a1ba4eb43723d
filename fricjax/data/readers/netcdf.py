"""Records in netCDF files: version 4 is HDF5, SciPy reads version 3."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import netcdf_file

from ...errors import DataError
from . import hdf5
from .choice import Choice
from .hdf5 import cf_unit, cf_values
from .sheet import Column, Sheet, array_columns, signal

# First bytes of a file of version 3; the last one selects offsets of 32 or 64 bits.
_VERSIONS = (b"CDF\x01", b"CDF\x02")


@contextmanager
def open_sheet(path: Path, choice: Choice) -> Iterator[Sheet]:
    """Open a netCDF file of version 3 or 4.

    The names of the columns are those of variables (with their groups in version 4). The times of a column are its
    coordinate variable.
    """
    with path.open("rb") as stream:
        head = stream.read(4)
    if not head.startswith(b"CDF"):
        with hdf5.open_sheet(path, choice) as content:
            yield content
        return
    if head not in _VERSIONS:
        raise DataError(
            f"{path.name} is of version CDF-{head[3:].hex() or '?'}, which is not read; convert it to netCDF-4."
        )
    with netcdf_file(path, "r", mmap=False) as file:
        yield _sheet(path, dict(file.variables))


def _sheet(path: Path, variables: dict[str, Any]) -> Sheet:
    """Return the variables as columns.

    A variable with the name of a dimension holds the coordinates along it.
    """
    columns = {name: _columns(name, each) for name, each in variables.items() if np.ndim(each.data)}

    def complete(name: str, part: Column) -> Column:
        coordinate = next((each for each in variables[name].dimensions if each in columns), name)
        return part if coordinate == name else dataclasses.replace(part, time=columns[coordinate][0])

    def values(name: str) -> np.ndarray:
        return cf_values(np.asarray(variables[name].data), _attribute_of(variables[name]), f"'{name}' in {path.name}")

    load = lambda wanted: [signal(values(name), index) for name, index in (each.key for each in wanted)]
    return Sheet([complete(name, part) for name, parts in columns.items() for part in parts], load, of="variable")


def _columns(name: str, variable: Any) -> list[Column]:
    data, unit = np.asarray(variable.data), cf_unit(_attribute_of(variable)("units"))
    return array_columns(name, data.dtype, data.shape, name, unit=unit)


def _attribute_of(variable: Any) -> Callable[[str], Any]:
    """Return a function that looks up attributes of a variable.

    Texts are decoded; an array is reduced to its first entry.
    """
    attributes = variable._attributes

    def attribute(name: str) -> Any:
        value = attributes.get(name)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        return value if value is None or np.ndim(value) == 0 else next(iter(np.ravel(value)), None)

    return attribute
