"""MATLAB files, old and new, as one tree: dicts for structs, lists for cells, arrays for numbers, strings for text.

Version 5 files are read with scipy; version 7.3 files are HDF5 with MATLAB's conventions (reversed dimensions,
references for cells). Behind this module nobody needs to know which one a file was.
"""

import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError


def load_tree(path: Path) -> dict[str, Any]:
    """Variables of a `.mat` file as a tree of dicts, lists, arrays and strings."""
    with path.open("rb") as file:
        head = file.read(1024)
    # Files of version 7.3 carry HDF5's signature after a block of text of 512 bytes.
    if head[:8] == b"\x89HDF\r\n\x1a\n" or head[512:520] == b"\x89HDF\r\n\x1a\n":
        return _load_hdf5(path)
    return _load_v5(path)


def _load_v5(path: Path) -> dict[str, Any]:
    import scipy.io

    try:
        variables = scipy.io.loadmat(path)
    except (
        ValueError,
        TypeError,
        OSError,
        KeyError,
        IndexError,
        NotImplementedError,
        zlib.error,
        MemoryError,
    ) as error:
        raise _unreadable(path, error) from error
    except Exception as error:  # MatReadError is an Exception of its own
        if type(error).__name__ != "MatReadError":
            raise
        raise _unreadable(path, error) from error
    return {name: _from_v5(value) for name, value in variables.items() if not name.startswith("__")}


def _unreadable(path: Path, error: Exception) -> DataError:
    return DataError(f"{path.name} cannot be read as a MATLAB file ({error}); it is damaged or of another format.")


def _from_v5(value: Any) -> Any:
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


def _load_hdf5(path: Path) -> dict[str, Any]:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return {name: _from_hdf5(file, node) for name, node in file.items() if not name.startswith("#")}
    except OSError as error:
        raise _unreadable(path, error) from error


def _from_hdf5(file: Any, node: Any) -> Any:
    import h5py

    if isinstance(node, h5py.Group):
        return {name: _from_hdf5(file, child) for name, child in node.items()}
    kind = node.attrs.get("MATLAB_class", b"")
    if node.attrs.get("MATLAB_empty", 0):
        return "" if kind == b"char" else np.zeros((0, 0))
    value = node[()]
    if h5py.check_ref_dtype(node.dtype) is not None:
        return [_from_hdf5(file, file[reference]) for reference in np.asarray(value).ravel()]
    if kind == b"char":
        return "".join(chr(code) for code in np.asarray(value).ravel())
    return np.asarray(value).T
