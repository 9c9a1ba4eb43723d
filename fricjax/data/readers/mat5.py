"""MATLAB files of version 4 and 5 before they are read: are their parts where and as large as they claim?

A file of version 5 is a row of elements, each with a tag of its type and size; matrices hold elements in their turn,
and a packed element holds one matrix. scipy believes the tags and the dimensions. The format is that of "MAT-File
Format" (The MathWorks, 2019).
"""

import math
import mmap
import struct
import zlib
from pathlib import Path

from ..content import allowance, gigabytes
from ..errors import DataError
from .nodes import DEEPEST

_UINT32, _MATRIX, _PACKED = 6, 14, 15
_CELL, _STRUCT, _OBJECT, _SPARSE, _OPAQUE = 1, 2, 3, 5, 17
_TAG = 8  # bytes
# Elements of one file; a cell takes four.
_ELEMENTS = 200_000
_HEADER = 128
# Dimensions of characters that are left out, as blanks are, may exceed the bytes that follow.
_BLANKS = 10_000
_V4_SIZES = (8, 4, 4, 2, 2, 1)


def check_v4(path: Path) -> None:
    """Refuses a file of version 4 whose matrices do not lie in it one after the other."""
    size = path.stat().st_size
    if size > allowance(path):
        raise DataError(f"{path.name} has {gigabytes(size)}; save time and displacement into a file of theirs.")
    with path.open("rb") as file:
        place = 0
        while place < size:
            file.seek(place)
            head = file.read(20)
            order = "<" if int.from_bytes(head[:4], "little") < 5000 else ">"
            kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", head)
            if not 0 <= kind // 10 % 10 < len(_V4_SIZES) or min(rows, columns) < 0 or not 0 < name < 1000:
                raise DataError(f"{path.name} cannot be read as a MATLAB file; it is damaged or of another format.")
            numbers = rows * columns * (2 if imaginary and kind % 10 != 2 else 1)
            place += 20 + name + numbers * _V4_SIZES[kind // 10 % 10]
    if place != size:
        raise DataError(f"{path.name} cannot be read as a MATLAB file; it is damaged: its end is missing.")


def sound_variables(path: Path) -> tuple[list[str], dict[str, str]]:
    """Names of the variables of a version 5 file that can be read, and why not for those that cannot.

    Raises:
        DataError: the file is damaged.
    """
    left, sound, refused = allowance(path), [], {}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        order = ">" if data[126:128] == b"MI" else "<"
        place = _HEADER
        while place + _TAG <= len(data):
            kind, size = struct.unpack_from(f"{order}2I", data, place)
            end = place + _TAG + size
            if kind not in (_MATRIX, _PACKED) or end > len(data):
                raise _damaged(path, f"byte {place}")
            packed = data[place + _TAG : end] if kind == _PACKED else None
            matrix = data[place:end] if packed is None else zlib.decompressobj().decompress(packed, left + 1)
            checked = _Matrix(path, matrix, order)
            reason = checked.refusal() if len(matrix) <= left else "more than plausible for a file of this size"
            if reason is None:
                sound.append(checked.name)
                left -= len(matrix)
            else:
                refused[checked.name] = reason
            place = end
    return sound, refused


def _damaged(path: Path, where: str) -> DataError:
    return DataError(
        f"{path.name} cannot be read as a MATLAB file: at {where} is no variable; it is damaged or of another format."
    )


class _Matrix:
    """One variable as its bytes, from its tag on."""

    def __init__(self, path: Path, data: bytes, order: str) -> None:
        self._path, self._data, self._order = path, data, order
        self.name = ""
        if len(data) > _TAG and struct.unpack_from(f"{order}I", data)[0] == _MATRIX:
            _, _, dimensions_end = self._shape(_TAG, len(data))
            _, start, size, _ = self._element(dimensions_end, len(data))
            self.name = data[start : start + size].decode("latin-1")

    def refusal(self) -> str | None:
        """Why the variable is not read; None where all that it holds lies in it."""
        kind, start, size, _ = self._element(0, len(self._data))
        if kind != _MATRIX:
            raise _damaged(self._path, "the beginning of a packed part")
        waiting, elements = [(start, start + size, 0)], 0
        while waiting:
            place, end, depth = waiting.pop()
            if depth > DEEPEST:
                return f"nested more than {DEEPEST} deep"
            if place < end:
                place = self._contents(place, end)
            while place + _TAG <= end:
                kind, start, size, following = self._element(place, end)
                elements += 1
                if kind == _MATRIX:
                    waiting.append((start, start + size, depth + 1))
                place = following
            if elements > _ELEMENTS:
                return f"it has more than {_ELEMENTS} parts"
        return None

    def _contents(self, place: int, end: int) -> int:
        """Where the parts of a matrix begin, whose flags and dimensions must be such as its size can hold."""
        kind, count, following = self._shape(place, end)
        rest = end - following
        most = rest // _TAG if kind in (_CELL, _STRUCT, _OBJECT) else rest + _BLANKS
        if kind != _SPARSE and count > most:
            raise DataError(
                f"{self._path.name} cannot be read as a MATLAB file: a variable claims {count:.3g} entries in {rest} "
                "bytes; it is damaged."
            )
        return following

    def _shape(self, place: int, end: int) -> tuple[int, int, int]:
        """Class of the matrix whose flags lie at a place, number of its entries, and where its dimensions end."""
        kind, start, size, following = self._element(place, end)
        if (kind, size) != (_UINT32, 8):
            raise _damaged(self._path, f"byte {place} of a variable")
        flags = struct.unpack_from(f"{self._order}I", self._data, start)[0] & 0xFF
        if flags == _OPAQUE:
            return flags, 0, following
        _, start, size, following = self._element(following, end)
        dimensions = struct.unpack_from(f"{self._order}{size // 4}i", self._data, start)
        if min(dimensions, default=-1) < 0:
            raise _damaged(self._path, f"byte {start} of a variable")
        return flags, math.prod(dimensions), following

    def _element(self, place: int, end: int) -> tuple[int, int, int, int]:
        """Type of the element at a place, where its data begin, how many bytes they are, and where the next one is."""
        kind, size = struct.unpack_from(f"{self._order}2I", self._data, place)
        if kind >> 16:
            # Up to four bytes lie in the tag itself, whose first half then holds type and size.
            return kind & 0xFFFF, place + 4, min(kind >> 16, 4), place + _TAG
        start = place + _TAG
        if start + size > end:
            raise _damaged(self._path, f"byte {place} of a variable")
        padded = size if kind == _MATRIX else size + -size % _TAG
        return kind, start, size, min(start + padded, end)
