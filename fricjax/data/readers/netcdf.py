"""Records in netCDF files: version 4 is HDF5, SciPy reads version 3.

Version 3 has neither groups nor packing. Its header lists the position of each variable. Several variables may share a
position, so the reader limits the number of bytes that it reads.
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

# First bytes of a file of version 3; the last one selects offsets of 32 or 64 bits.
_VERSIONS = (b"CDF\x01", b"CDF\x02")


def read_netcdf(path: Path, choice: Choice) -> Record | list[Record]:
    """Read two variables of a netCDF file of version 3 or 4.

    Options as in `fricjax.read`; `column` and `time` are names of variables (with their groups in version 4). The
    default time is the coordinate variable of the displacement.

    Raises:
        DataError: a damaged file, an unknown variable, or one that is not a vector of numbers.
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
        # SciPy accepts any object with the methods read, seek and tell.
        file = netcdf_file(cast(IO[bytes], stream), "r", mmap=False)
        return records_of(path, "netcdf", _sheet(path, dict(file.variables)), choice)


class _Metered(io.FileIO):
    """A file that refuses to read implausibly many bytes."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._path, self._read = path, 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size) or b""
        self._read += len(data)
        check_size(self._path, "The content", self._read // NUMBER)
        return data


def _sheet(path: Path, variables: dict[str, Any]) -> Sheet:
    """Return the variables as columns.

    A variable with the name of a dimension holds the coordinates along it.
    """
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


def _values(path: Path, name: str, variable: Any) -> np.ndarray:
    return cf_values(np.asarray(variable.data), _attribute_of(variable), f"'{name}' in {path.name}")
