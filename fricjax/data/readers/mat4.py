"""MATLAB files of version 4: matrices one after the other, each behind five numbers that say what it is."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..content import allowance, gigabytes
from .mat5 import Opaque, damaged

_HEAD = 20  # bytes
_KINDS = ("f8", "f4", "i4", "i2", "u2", "u1")
_NUMBERS, _TEXT = 0, 1
_LONGEST_NAME = 1000


def load_v4(path: Path) -> dict[str, Any]:
    """Variables by name as arrays, texts and, of sparse matrices, `Opaque`.

    Raises:
        DataError: the file is damaged.
    """
    if path.stat().st_size > allowance(path):
        size = gigabytes(path.stat().st_size)
        raise DataError(f"{path.name} has {size}; save time and displacement into a file of theirs.")
    data, place, found = path.read_bytes(), 0, {}
    while place < len(data):
        # The type is a number of four decimal digits, of which the first tells the order of bytes.
        order = "<" if int.from_bytes(data[place : place + 4], "little") < 1000 else ">"
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", data, place)
        kind -= 1000 * (order == ">")
        if kind not in range(60) or min(rows, columns) < 0 or not 0 < length < _LONGEST_NAME:
            raise damaged(path, f"byte {place}")
        stored, count = np.dtype(order + _KINDS[kind // 10]), rows * columns
        start = place + _HEAD + length
        place = start + count * stored.itemsize * (2 if imaginary and kind % 10 == _NUMBERS else 1)
        if place > len(data):
            raise damaged(path, f"byte {start}, after which {gigabytes(place - len(data))} are missing,")
        name = data[start - length : start].split(b"\0")[0].decode("latin-1")
        parts = np.frombuffer(data[start:place], stored).reshape(-1, count) if count else np.zeros((1, 0))
        found[name] = _value(parts, (rows, columns), kind % 10)
    return found


def _value(parts: np.ndarray, shape: tuple[int, int], kind: int) -> Any:
    """A matrix of real or complex numbers, the first line of a text, or something else."""
    real = parts[0].reshape(shape, order="F")
    if kind == _TEXT:
        return "".join(map(chr, real[0].astype(np.uint16))) if real.size else ""
    if kind != _NUMBERS:
        return Opaque("a sparse matrix")
    native = real.astype(real.dtype.newbyteorder("="))
    return native if len(parts) == 1 else native + 1j * parts[1].reshape(shape, order="F")
