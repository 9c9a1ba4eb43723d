"""MATLAB files, old and new, as one tree: dicts for structs, lists for cells, arrays for numbers, strings for text.

Version 4 and 5 files are read with scipy once :mod:`.mat5` has found them sound; version 7.3 files are HDF5 with
MATLAB's conventions (reversed dimensions, references for cells). Behind this module nobody needs to know which one a
file was.
"""

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..content import damage
from ..errors import DataError
from .mat5 import check_v4, sound_variables
from .nodes import DEEPEST, MOST, Tree, opened

_HDF5 = b"\x89HDF\r\n\x1a\n"


class Opaque(NamedTuple):
    """What is no number, text, structure or cell array, or is not read: what it is, in words that follow "it is"."""

    kind: str


def load_tree(path: Path) -> dict[str, Any]:
    """Variables of a `.mat` file as a tree of dicts, lists, arrays (of which some are complex), strings and `Opaque`.

    Raises:
        DataError: a damaged file, or one of another format.
    """
    with path.open("rb") as file:
        head = file.read(1024)
    # Files of version 7.3 carry HDF5's signature after a block of text of 512 bytes.
    if head.startswith(_HDF5) or head[512:520] == _HDF5:
        with opened(path, "a MATLAB file") as tree:
            return _Branches(tree).of(tree.file["/"], 0)
    with damage(path, "a MATLAB file"):
        return _load_old(path, head)


def _load_old(path: Path, head: bytes) -> dict[str, Any]:
    import scipy.io

    refused: dict[str, str] = {}
    sound = None
    # The four letters at the beginning are text from version 5 on and a small number before.
    if 0 in head[:4]:
        check_v4(path)
    else:
        sound, refused = sound_variables(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        variables = scipy.io.loadmat(path, variable_names=sound)
    found = {name: _from_v5(value) for name, value in variables.items() if not name.startswith("__")}
    return {**found, **{name: Opaque(reason) for name, reason in refused.items()}}


def _from_v5(value: Any) -> Any:
    import scipy.sparse
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    if scipy.sparse.issparse(value):
        return Opaque("a sparse matrix")
    if isinstance(value, MatlabFunction):
        return Opaque("a function")
    if isinstance(value, MatlabObject | MatlabOpaque):
        return Opaque("an object of a class")
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype.names:
        structs = [{name: _from_v5(item[name]) for name in value.dtype.names} for item in value.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        return [_from_v5(item) for item in value.ravel(order="F")]
    if value.dtype.kind in "US":
        return str(value.ravel()[0]) if value.size else ""
    return value


class _Branches:
    """The nodes of an HDF5 file as MATLAB means them; cells refer to nodes, and may do so in a circle."""

    def __init__(self, tree: Tree) -> None:
        self._tree, self._left = tree, MOST

    def of(self, node: Any, depth: int) -> Any:
        """A struct, a cell array, text, numbers, or why it is none of them."""
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
            children = self._tree.children(node)
            return {name: self.of(child, depth + 1) for name, child in children.items() if not name.startswith("#")}
        if attribute("MATLAB_empty"):
            return "" if attribute("MATLAB_class") == "char" else np.zeros((0, 0))
        reason = self._tree.refusal(node)
        if reason is not None:
            return Opaque(f"not read: {reason}")
        return self._value(self._tree.read(node), attribute("MATLAB_class"), depth)

    def _value(self, value: np.ndarray, kind: Any, depth: int) -> Any:
        import h5py

        if h5py.check_ref_dtype(value.dtype) is not None:
            if value.size > self._left:
                return Opaque(f"a cell array in a file of more than {MOST} cells and variables")
            return [self._cell(reference, depth) for reference in value.ravel()]
        if kind == "char" and value.dtype.kind in "iu":
            return value.astype("<u2").tobytes().decode("utf-16-le", "replace")
        if value.dtype.names == ("real", "imag"):
            return (value["real"] + 1j * value["imag"]).T
        return value.T

    def _cell(self, reference: Any, depth: int) -> Any:
        if self._left <= 0:
            return Opaque(f"in a file of more than {MOST} cells and variables")
        node = self._tree.file[reference]
        if not hasattr(node, "attrs"):
            raise DataError(f"A cell of {self._tree.path.name} refers to nothing; the file is damaged.")
        return self.of(node, depth + 1)
