"""Safe reader of archives of numpy arrays.

All sizes are checked before anything is unpacked, and objects are never unpickled. An archive is a zip file of arrays,
each with a header. Both the archive and the header state a length, and both can be wrong.
"""

import math
import warnings
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...errors import DataError, brief, quoted
from ..files import NUMBER, allowance, damage, gigabytes
from ..native import MARK, check_schema, decode
from ..record import Record
from .assemble import records_of, with_choice
from .choice import Choice
from .header import names_rate
from .sheet import Column, Sheet, array_columns, signal


def read_npz(path: Path, choice: Choice) -> Record | list[Record]:
    """Read two arrays of an `.npz` archive, or a record from `fricjax.write`.

    Options as in `fricjax.read`; names may contain units, as in `x_mm`.
    """
    arrays = load_arrays(path)
    if MARK in arrays and choice.takes_all:
        check_schema(arrays[MARK], path.name)
        texts = {name: str(arrays.get(name, "")) for name in ("meta", "log")}
        return with_choice(decode(arrays, texts, path.name), choice)
    vectors = {name: array for name, array in arrays.items() if (array.ndim or names_rate(name)) and name != "mask"}
    if not vectors:
        raise DataError(f"{path.name} holds no arrays of numbers (only {quoted(list(arrays)) or 'nothing'}).")
    columns = [part for name, array in vectors.items() for part in array_columns(name, array.dtype, array.shape, name)]

    def load(wanted: Sequence[Column]) -> list[np.ndarray]:
        return [signal(vectors[name], index) for name, index in (column.key for column in wanted)]

    return records_of(path, "npz", Sheet(columns, load), choice)


# Largest number of members, and of bytes in the list of members; numpy takes about 60 bytes for each.
_MEMBERS, _DIRECTORY = 10_000, 1_000_000
_END_OF_DIRECTORY = b"PK\x05\x06"
_PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_LONGEST_NAME = 200
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_HINT = "it is damaged, of another format, or holds pickled objects, which are refused"


def load_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays by name, in the order of the archive.

    Other members are left out.

    Raises:
        DataError: no such archive, a damaged one, pickled objects, or more than is plausible for a file of this size.
    """
    _check_ends(path)
    with damage(path, ".npz", _HINT), zipfile.ZipFile(path) as archive, warnings.catch_warnings():
        warnings.simplefilter("error")
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        _check_members(path, members)
        arrays = {}
        for member in members:
            with archive.open(member) as file:
                arrays[member.filename.removesuffix(".npy")] = _array(path, member, file)
        return arrays


def _check_ends(path: Path) -> None:
    """Check the beginning and the end of the file.

    This precedes the reading of the list of members.
    """
    with path.open("rb") as file:
        head = file.read(6)
        file.seek(max(0, path.stat().st_size - (1 << 16) - 22))
        tail = file.read()
    if head == b"\x93NUMPY":
        raise DataError(f"{path.name} is a single array, not an archive of named arrays; write it with numpy.savez.")
    # A comment of at most 65,535 bytes may follow.
    end = tail[tail.rfind(_END_OF_DIRECTORY) :]
    if not head.startswith(b"PK") or not end.startswith(_END_OF_DIRECTORY) or len(end) < 22:
        raise DataError(f"{path.name} cannot be read as .npz; {_HINT}.")
    if int.from_bytes(end[12:16], "little") > _DIRECTORY:
        raise DataError(f"{path.name} has more members than a record; write time and displacement to a separate file.")


def _check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    if len(members) > _MEMBERS:
        raise DataError(f"{path.name} has {len(members)} arrays, but at most {_MEMBERS} are expected of a record.")
    counts = Counter(member.filename for member in members)
    for name, count in counts.items():
        if len(name) > _LONGEST_NAME or not name.isprintable():
            raise DataError(
                f"{path.name} has a member of the name {brief(name)}, which is not the name of an array; rename it."
            )
        if count > 1:
            raise DataError(f"{path.name} has several members '{name}'; write it again with unique names.")
    size, allowed = sum(member.file_size for member in members), allowance(path)
    if size > allowed:
        raise DataError(
            f"{path.name} would have {gigabytes(size)} unpacked, but at most {gigabytes(allowed)} are expected of a "
            "file of this size; write time and displacement to a separate file."
        )
    for member in members:
        if member.compress_type not in _PACKINGS:
            raise DataError(
                f"{path.name}: '{member.filename}' is not packed as numpy packs arrays; write it with numpy."
            )


def _array(path: Path, member: zipfile.ZipInfo, file: IO[bytes]) -> np.ndarray:
    """Read one array; its header must match the size of its member."""
    version = np.lib.format.read_magic(file)
    if version not in _HEADERS:
        raise DataError(f"{path.name}: '{member.filename}' is no plain array but of structure {version}.")
    shape, by_columns, dtype = _HEADERS[version](file)
    if dtype.hasobject:
        raise DataError(f"{path.name}: '{member.filename}' holds pickled objects, which are refused; write numbers.")
    size = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or size != member.file_size - file.tell() or dtype.itemsize == 0:
        raise DataError(
            f"{path.name} is damaged: '{member.filename}' promises {dtype} of shape {brief(shape)} and holds "
            f"{member.file_size} bytes."
        )
    if math.prod(shape) * NUMBER > allowance(path):
        raise DataError(f"{path.name}: '{member.filename}' has {math.prod(shape):.3g} numbers, more than a record.")
    return _filled(file, size, dtype).reshape(shape, order="F" if by_columns else "C")


def _filled(file: IO[bytes], size: int, dtype: Any) -> np.ndarray:
    data = bytearray(size)
    view, place = memoryview(data), 0
    while place < size:
        read = file.readinto(view[place:])  # pyright: ignore[reportAttributeAccessIssue]
        if not read:
            raise EOFError(f"{size - place} bytes are missing")
        place += read
    # Reading on to the end makes zipfile compare the checksum.
    file.read(1)
    return np.frombuffer(data, dtype)
