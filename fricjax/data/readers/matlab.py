"""MATLAB files of all versions as one tree.

Structs become dicts, cell arrays lists, numbers arrays and text strings. SciPy reads versions 4 and 5. Files of version
7.3 are HDF5 with MATLAB's conventions (reversed dimensions, references for cells); their numbers stay data sets.
"""

from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import scipy.io
import scipy.sparse
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

from ...errors import DataError
from ..files import allowance, gigabytes
from .nodes import attribute, children, elsewhere, referred


class Opaque(NamedTuple):
    """A value that is not read; `kind` follows "it is" in messages."""

    kind: str


def load_tree(path: Path, file: h5py.File | None) -> dict[str, Any]:
    """Read the variables of a `.mat` file as a tree.

    The nodes are dicts, lists, arrays (real or complex), data sets, strings and `Opaque`. `file` is the open file if it
    is of version 7.3.
    """
    if file is None and path.stat().st_size > allowance(path):
        size = gigabytes(path.stat().st_size)
        raise DataError(f"{path.name} has {size}; save time and displacement to a separate file.")
    if file is not None:
        variables = _Branches(path, file).fields(file["/"])
    else:
        variables = {name: _value(value) for name, value in scipy.io.loadmat(path).items()}
    # Function workspaces have no name. Names with underscores or signs in front are internal.
    return {name: each for name, each in variables.items() if name.isidentifier() and not name.startswith("__")}


def numbers_of(node: Any) -> np.ndarray:
    """Return the numbers of an array or a data set."""
    return node[()].T if isinstance(node, h5py.Dataset) else node


def _value(value: Any) -> Any:
    """Convert a value from SciPy to the node of a tree."""
    if scipy.sparse.issparse(value):
        return Opaque("a sparse matrix")
    if isinstance(value, MatlabFunction):
        return Opaque("a function")
    if isinstance(value, MatlabObject | MatlabOpaque):
        return Opaque("an object")
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype.names:
        names = value.dtype.names
        structs = [{name: _value(each[name]) for name in names} for each in value.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype.kind == "O":
        return [_value(each) for each in value.ravel(order="F")]
    if value.dtype.kind == "U":
        return str(value.ravel()[0]) if value.size else ""
    return value


class _Branches:
    """The nodes of an HDF5 file by MATLAB's conventions."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self._path, self._file = path, file
        # Several cells may refer to the same node.
        self._known: dict[Any, Any] = {}

    def fields(self, group: Any) -> dict[str, Any]:
        """Return the children of a group by name."""
        return {name: self._of(child) for name, child in children(group).items() if not name.startswith("#")}

    def _of(self, node: Any) -> Any:
        """Return a struct, cell array, text or numbers, or an `Opaque` node."""
        kind = attribute(node, "MATLAB_class")
        if attribute(node, "MATLAB_sparse") is not None:
            return Opaque("a sparse matrix")
        if attribute(node, "MATLAB_object_decode"):
            return Opaque(f"an object of the class {kind}")
        if isinstance(node, h5py.Group):
            return self.fields(node)
        if attribute(node, "MATLAB_empty"):
            return "" if kind == "char" else np.zeros((0, 0))
        if elsewhere(node):
            return Opaque("in another file, which is not opened")
        if h5py.check_ref_dtype(node.dtype) is not None:
            return [self._cell(reference) for reference in np.ravel(node[()])]
        if kind == "char" and node.dtype.kind in "iu":
            return node[()].astype("<u2").tobytes().decode("utf-16-le", "replace")
        if node.dtype.kind == "O":
            return Opaque("a list of texts")
        return node[()]["real"] + 1j * node[()]["imag"] if node.dtype.names == ("real", "imag") else node

    def _cell(self, reference: Any) -> Any:
        node = referred(self._file, reference)
        if node is None:
            raise DataError(f"A cell of {self._path.name} refers to nothing; the file is damaged.")
        if node.id not in self._known:
            self._known[node.id] = self._of(node)
        return self._known[node.id]
