"""Reader of MATLAB files of version 5.

It exists because SciPy's reader crashes the process on some damaged files. A file is a sequence of elements, each with
a tag for type and size. Matrices contain further elements: flags, dimensions, a name, and numbers, text or further
matrices. A packed element holds one matrix. Types, sizes and dimensions are accepted only if the bytes exist ("MAT-File
Format", The MathWorks, 2019).
"""

import math
import mmap
import struct
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import DataError
from ..files import NUMBER, allowance
from .nodes import DEEPEST

_HEADER, _TAG = 128, 8  # bytes
_INT8, _INT32, _UINT32, _MATRIX, _PACKED, _UTF8 = 1, 5, 6, 14, 15, 16
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_COMPLEX, _LOGICAL = 0x0800, 0x0200
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
_NOT_READ = {_SPARSE: "a sparse matrix", _OBJECT: "an object of a class", _FUNCTION: "a function", _OPAQUE: "an object"}
_TOO_LARGE = "not read: it is larger than plausible for a file of this size"
# Largest number of matrices in one file; reading a million takes seconds.
_PARTS = 200_000


class Opaque(NamedTuple):
    """A value that is not read; `kind` follows "it is" in messages."""

    kind: str


def load_v5(path: Path) -> dict[str, Any]:
    """Read the variables by name: arrays, texts, dicts, lists and `Opaque`.

    Structs become dicts and cell arrays become lists.

    Raises:
        DataError: the file is damaged.
    """
    left, parts, variables = allowance(path), _PARTS, {}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        order = ">" if data[126:128] == b"MI" else "<"
        place = _HEADER
        if len(data) < place:
            raise damaged(path, f"an end after {len(data)} bytes")
        while place + _TAG <= len(data):
            kind, size = struct.unpack_from(f"{order}2I", data, place)
            end = place + _TAG + size
            if kind not in (_MATRIX, _PACKED) or end > len(data):
                raise damaged(path, f"byte {place}")
            # Read at least the name of a variable that is too large.
            cut = min(end, place + left)
            part = data[place:cut] if kind == _MATRIX else _unpacked(data[place + _TAG : cut], left + 1)
            variable = _Variable(path, part, order, parts)
            name = variable.name()
            if len(part) > left or cut < end:
                variables[name] = Opaque(_TOO_LARGE)
            else:
                variables[name] = variable.matrix(_TAG, len(part), 0)
                left, parts = left - len(part), variable.left
            place = end
    return variables


def _unpacked(data: bytes, most: int) -> bytes:
    unpacking = zlib.decompressobj()
    part = unpacking.decompress(data, most)
    # Packed data may end early without a checksum error.
    if len(part) < most and not unpacking.eof:
        raise EOFError("a packed part ends early")
    return part


def damaged(path: Path, where: str) -> DataError:
    """Return the error for a position with unexpected content."""
    return DataError(f"{path.name} cannot be read as a MATLAB file: {where} does not fit; it is damaged.")


class _Variable:
    """The bytes of one variable, from its tag on.

    `left` is the number of further matrices that may be read.
    """

    def __init__(self, path: Path, data: bytes, order: str, left: int) -> None:
        self._path, self._data, self._order = path, data, order
        self.left = left
        if len(data) < _TAG or struct.unpack_from(f"{order}I", data)[0] != _MATRIX:
            raise damaged(path, "the beginning of a variable")

    def name(self) -> str:
        """Return the name, which follows flags and dimensions."""
        place, end = _TAG, len(self._data)
        flags, place = self._flags(place, end)
        if flags & 0xFF != _OPAQUE:
            _, place = self._shape(place, end)
        return self._part(place, end, (_INT8, _UTF8))[1].decode("utf-8", "replace")

    def matrix(self, place: int, end: int, depth: int) -> Any:
        """Read the matrix between two positions, according to its class."""
        self.left -= 1
        if depth > DEEPEST:
            return Opaque(f"nested more than {DEEPEST} deep")
        if self.left < 0:
            return Opaque(f"in a file of more than {_PARTS} cells and fields")
        if place == end:
            return np.zeros((0, 0))
        flags, place = self._flags(place, end)
        kind = flags & 0xFF
        if kind in _NOT_READ:
            return Opaque(_NOT_READ[kind])
        shape, place = self._shape(place, end)
        _, _, place = self._part(place, end, (_INT8, _UTF8))
        if kind == _CELL:
            return self._matrices(math.prod(shape), place, end, depth)
        if kind == _STRUCT:
            return self._structs(math.prod(shape), place, end, depth)
        if kind == _CHAR:
            return self._text(shape, place, end)
        if kind not in _CLASSES:
            raise damaged(self._path, f"a variable of class {kind}")
        if math.prod(shape) * NUMBER > allowance(self._path):
            return Opaque(_TOO_LARGE)
        values, place = self._numbers(shape, place, end)
        if flags & _COMPLEX:
            return values + 1j * self._numbers(shape, place, end)[0]
        return values != 0 if flags & _LOGICAL else values.astype(_CLASSES[kind])

    def _part(self, place: int, end: int, kinds: Any) -> tuple[int, bytes, int]:
        """Return type and data of an element, and the next position.

        The type must be in `kinds`.
        """
        if place + _TAG > end:
            raise damaged(self._path, "the end of a variable")
        kind, size = struct.unpack_from(f"{self._order}2I", self._data, place)
        start, following = place + _TAG, 0
        if kind >> 16:
            # A small element stores up to four bytes in its tag; the first half of the tag then holds size and type.
            kind, size, start, following = kind & 0xFFFF, kind >> 16, place + 4, start
        if kind not in kinds or start + size > end or (following and size > 4):
            raise damaged(self._path, f"an element of type {kind} and {size} bytes")
        return kind, self._data[start : start + size], following or min(start + size + -size % _TAG, end)

    def _flags(self, place: int, end: int) -> tuple[int, int]:
        _, data, place = self._part(place, end, (_UINT32,))
        return struct.unpack_from(f"{self._order}I", data)[0], place

    def _shape(self, place: int, end: int) -> tuple[tuple[int, ...], int]:
        _, data, place = self._part(place, end, (_INT32, _UINT32))
        shape = struct.unpack(f"{self._order}{len(data) // 4}i", data)
        if not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise damaged(self._path, f"a variable of shape {shape[:32]}")
        return shape, place

    def _numbers(self, shape: tuple[int, ...], place: int, end: int) -> tuple[np.ndarray, int]:
        kind, data, place = self._part(place, end, _STORED)
        values = np.frombuffer(data, self._order + _STORED[kind])
        if values.size != math.prod(shape):
            raise damaged(self._path, f"a variable of shape {shape} with {values.size} numbers")
        return values.reshape(shape, order="F"), place

    def _text(self, shape: tuple[int, ...], place: int, end: int) -> str:
        """Return the text, or its first line.

        Lines are the rows of a character array stored by columns.
        """
        kind, data, _ = self._part(place, end, _ENCODINGS)
        wide = {"<": "-le", ">": "-be"}[self._order] if _ENCODINGS[kind] in ("utf-16", "utf-32") else ""
        text = data.decode(_ENCODINGS[kind] + wide, "replace")
        return text[:: shape[0]] if shape[0] > 1 and len(text) == math.prod(shape) else text

    def _matrices(self, count: int, place: int, end: int, depth: int) -> list[Any]:
        if count > (end - place) // _TAG:
            raise damaged(self._path, f"a variable of {count} parts in {end - place} bytes")
        matrices = []
        for _ in range(count):
            kind, size = struct.unpack_from(f"{self._order}2I", self._data, place) if place + _TAG <= end else (0, 0)
            following = place + _TAG + size
            if kind != _MATRIX or following > end:
                raise damaged(self._path, f"an element of type {kind} and {size} bytes among cells or fields")
            matrices.append(self.matrix(place + _TAG, following, depth + 1))
            place = following
        return matrices

    def _structs(self, count: int, place: int, end: int, depth: int) -> Any:
        """Return the fields by name, or a list for a struct array."""
        _, data, place = self._part(place, end, (_INT32, _UINT32))
        length = struct.unpack_from(f"{self._order}i", data)[0]
        _, data, place = self._part(place, end, (_INT8, _UTF8))
        if length < 1:
            raise damaged(self._path, f"a structure with names of {length} letters")
        names = [data[i : i + length].split(b"\0")[0].decode("utf-8", "replace") for i in range(0, len(data), length)]
        if not names:
            return {}
        values = self._matrices(count * len(names), place, end, depth)
        structs = [dict(zip(names, values[i : i + len(names)], strict=True)) for i in range(0, len(values), len(names))]
        return structs[0] if len(structs) == 1 else structs
