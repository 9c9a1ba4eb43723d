"""Records in netCDF files: those of version 4 are HDF5 files, those of version 3 are read by SciPy.

Version 3 has no groups and no packing: what lies where is listed at the beginning, and any number of variables may lie
in one place, so that the bytes that are read are counted.
"""

import dataclasses
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from ...errors import DataError
from ..files import NUMBER, check_size, damage
from ..record import Record
from .assemble import records_of
from .choice import Choice
from .hdf5 import cf_unit, cf_values, read_hdf5
from .sheet import Column, Sheet, array_columns, signal

# How a file of version 3 begins; the last byte tells apart those whose places have 32 and 64 bits.
_VERSIONS = (b"CDF\x01", b"CDF\x02")


def read_netcdf(path: Path, choice: Choice) -> Record | list[Record]:
    """Reads two variables of a netCDF file of version 3 or 4.

    Options as in `fricjax.read`, where `column` and `time` are names of variables (with their groups in version 4); the
    time is by default the coordinate variable of the displacement.

    Raises:
        DataError: a damaged file, an unknown variable, one that is no vector of numbers.
    """
    with path.open("rb") as file:
        head = file.read(4)
    if not head.startswith(b"CDF"):
        return read_hdf5(path, choice)
    if head not in _VERSIONS:
        raise DataError(
            f"{path.name} is of version CDF-{head[3:].hex() or '?'}, which is not read; convert it to netCDF-4."
        )
    from scipy.io import netcdf_file

    with damage(path, "netCDF"), _Metered(path) as stream:
        # SciPy takes anything that reads, seeks and tells.
        file = netcdf_file(cast(IO[bytes], stream), "r", mmap=False)
        return records_of(path, "netcdf", _sheet(path, dict(file.variables)), choice)


class _Metered(io.FileIO):
    """A file of which no more bytes are read than are plausible for its size."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._path, self._read = path, 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size) or b""
        self._read += len(data)
        check_size(self._path, "What is listed", self._read // NUMBER)
        return data


def _sheet(path: Path, variables: dict[str, Any]) -> Sheet:
    """The variables as columns; the one that is called as a dimension holds the places along it."""
    columns = {name: _columns(name, each) for name, each in variables.items() if np.ndim(each.data)}

    def complete(name: str, part: Column) -> Column:
        coordinate = next((each for each in variables[name].dimensions if each in columns), name)
        return part if coordinate == name else dataclasses.replace(part, time=columns[coordinate][0])

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [signal(_values(path, name, variables[name]), index) for name, index in (each.key for each in wanted)]

    return Sheet([complete(name, part) for name, parts in columns.items() for part in parts], load, of="variable")


def _columns(name: str, variable: Any) -> list[Column]:
    data, unit = np.asarray(variable.data), cf_unit(_attribute_of(variable)("units"))
    return array_columns(name, data.dtype, data.shape, name, unit=unit)


def _attribute_of(variable: Any) -> Callable[[str], Any]:
    """What gives the attributes of a variable: texts decoded, and of several entries the first."""
    attributes = variable._attributes

    def attribute(name: str) -> Any:
        value = attributes.get(name)
        if isinstance(value, bytes):
            return value.decode("utf-8", "replace")
        return value if value is None or np.ndim(value) == 0 else next(iter(np.ravel(value)), None)

    return attribute


def _values(path: Path, name: str, variable: Any) -> np.ndarray:
    return cf_values(np.asarray(variable.data), _attribute_of(variable), f"'{name}' in {path.name}")
