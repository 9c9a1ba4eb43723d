"""MATLAB files of all versions as one tree.

Structs become dicts, cell arrays lists, numbers arrays and text strings. Versions 4 and 5 have separate formats. Files
of version 7.3 are HDF5 with MATLAB's conventions (reversed dimensions, references for cells). The tree is the same for
all.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..files import allowance, damage, gigabytes
from .mat5 import Opaque, damaged, load_v5
from .nodes import DEEPEST, MOST, NotRead, Tree, opened

_HDF5 = b"\x89HDF\r\n\x1a\n"


def load_tree(path: Path) -> dict[str, Any]:
    """Read the variables of a `.mat` file as a tree.

    The nodes are dicts, lists, arrays (real or complex), strings and `Opaque`.

    Raises:
        DataError: a damaged file, or one of another format.
    """
    with path.open("rb") as file:
        head = file.read(1024)
    # Files of version 7.3 carry HDF5's signature after a block of text of 512 bytes.
    if head.startswith(_HDF5) or head[512:520] == _HDF5:
        with opened(path, "a MATLAB file") as tree:
            variables = _Branches(tree).fields(tree.file["/"], 0)
    else:
        with damage(path, "a MATLAB file"):
            # The first four bytes are text from version 5 on, and a small number in version 4.
            variables = load_v4(path) if 0 in head[:4] else load_v5(path)
    # Function workspaces have no name, and internal variables of version 7.3 have names that are not identifiers.
    return {name: value for name, value in variables.items() if name.isidentifier()}


class _Branches:
    """The nodes of an HDF5 file by MATLAB's conventions.

    Cells refer to nodes, possibly in a circle.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree, self._left = tree, MOST
        # Value and number of nodes of each reference, by address, because several cells may refer to the same node.
        self._known: dict[Any, tuple[Any, int]] = {}

    def of(self, node: Any, depth: int) -> Any:
        """Return a struct, cell array, text or numbers, or an `Opaque` node."""
        import h5py

        self._left -= 1
        if depth > DEEPEST:
            return Opaque(f"nested more than {DEEPEST} deep")
        attribute = lambda name: self._tree.attribute(node, name)
        if attribute("MATLAB_sparse") is not None:
            return Opaque("a sparse matrix")
        if attribute("MATLAB_object_decode"):
            return Opaque(f"an object of the class {attribute('MATLAB_class')}")
        if isinstance(node, h5py.Group):
            return self.fields(node, depth)
        if attribute("MATLAB_empty"):
            return "" if attribute("MATLAB_class") == "char" else np.zeros((0, 0))
        try:
            value = self._tree.read(node)
        except NotRead as error:
            return Opaque(f"not read: {error.reason}")
        if h5py.check_ref_dtype(value.dtype) is not None:
            return self._cells(value.ravel(), depth)
        if attribute("MATLAB_class") == "char" and value.dtype.kind in "iu":
            return value.astype("<u2").tobytes().decode("utf-16-le", "replace")
        if value.dtype.names == ("real", "imag"):
            return (value["real"] + 1j * value["imag"]).T
        return value.T != 0 if attribute("MATLAB_class") == "logical" else value.T

    def fields(self, group: Any, depth: int) -> dict[str, Any]:
        """Return the children of a group by name."""
        children = self._tree.children(group)
        return {name: self.of(child, depth + 1) for name, child in children.items() if not name.startswith("#")}

    def _cells(self, references: np.ndarray, depth: int) -> Any:
        if references.size > self._left:
            return Opaque(f"a cell array in a file of more than {MOST} cells and variables")
        return [self._cell(reference, depth) for reference in references]

    def _cell(self, reference: Any, depth: int) -> Any:
        node = self._tree.referred(reference)
        if node is None:
            raise DataError(f"A cell of {self._tree.path.name} refers to nothing; the file is damaged.")
        before, (value, size) = self._left, self._known.get(node.id, (None, 0))
        if size > before:
            return Opaque(f"in a file of more than {MOST} cells and variables")
        if size:
            self._left -= size
            return value
        value = self.of(node, depth + 1)
        self._known[node.id] = value, before - self._left
        return value


_HEAD = 20  # bytes
_KINDS = ("f8", "f4", "i4", "i2", "u2", "u1")
_NUMBERS, _TEXT = 0, 1
_LONGEST_NAME = 1000


def load_v4(path: Path) -> dict[str, Any]:
    """Read the variables by name: arrays, texts, and `Opaque` for sparse matrices.

    Raises:
        DataError: the file is damaged.
    """
    if path.stat().st_size > allowance(path):
        size = gigabytes(path.stat().st_size)
        raise DataError(f"{path.name} has {size}; save time and displacement to a separate file.")
    data, place, variables = path.read_bytes(), 0, {}
    while place < len(data):
        # The type has four decimal digits; the first one encodes the byte order.
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
        variables[name] = _value(parts, (rows, columns), kind % 10)
    return variables


def _value(parts: np.ndarray, shape: tuple[int, int], kind: int) -> Any:
    """Return a real or complex matrix, a text's first line, or `Opaque`."""
    real = parts[0].reshape(shape, order="F")
    if kind == _TEXT:
        return "".join(map(chr, real[0].astype(np.uint16))) if real.size else ""
    if kind != _NUMBERS:
        return Opaque("a sparse matrix")
    native = real.astype(real.dtype.newbyteorder("="))
    return native if len(parts) == 1 else native + 1j * parts[1].reshape(shape, order="F")
