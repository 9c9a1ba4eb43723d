"""Nodes of an HDF5 file.

Only hard links are followed. Soft and external links, external storage and virtual data sets can lead to any other
file.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5r  # pyright: ignore[reportAttributeAccessIssue]


def children(group: Any) -> dict[str, Any]:
    """Return the groups and data sets in a group, by name."""
    hard = [name for name in group.id if group.id.links.get_info(name).type == h5l.TYPE_HARD]
    nodes = {name.decode("utf-8", "replace"): _node(h5o.open(group.id, name)) for name in hard}
    return {name: node for name, node in nodes.items() if node is not None}


def referred(file: h5py.File, reference: Any) -> Any:
    """Return the node of a reference, None if there is none."""
    return _node(h5r.dereference(reference, file.id))


def data_sets(file: h5py.File) -> dict[str, Any]:
    """Return all data sets by path, such as `"/run1/x"`.

    Each group is visited once.
    """
    sets: dict[str, Any] = {}
    waiting, seen = [("", file["/"])], set()
    while waiting:
        folder, group = waiting.pop(0)
        address = h5o.get_info(group.id).addr
        if address not in seen:
            seen.add(address)
            for name, node in children(group).items():
                if isinstance(node, h5py.Group):
                    waiting.append((f"{folder}/{name}", node))
                else:
                    sets[f"{folder}/{name}"] = node
    return sets


def elsewhere(node: Any) -> bool:
    """Return True if the numbers lie in another file."""
    return bool(node.is_virtual or node.external)


def attribute(node: Any, name: str, default: Any = None) -> Any:
    """Return a numeric or text attribute of a node.

    Texts are decoded; an array is reduced to its first entry.
    """
    if not h5a.exists(node.id, name.encode()):
        return default
    value = node.attrs[name]
    if isinstance(value, h5py.Empty) or not np.size(value):
        return default
    value = np.ravel(np.asarray(value, dtype=object))[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def scale(node: Any) -> str | None:
    """Return the path of the first dimension's coordinates.

    This follows the convention of netCDF.
    """
    if not h5a.exists(node.id, b"DIMENSION_LIST"):
        return None
    scales = node.dims[0]
    return scales[0].name if len(scales) else None


def is_hdf5(path: Path) -> bool:
    """Return True for a file with the signature of HDF5.

    Files of MATLAB have it after a text of 512 bytes.
    """
    signature = b"\x89HDF\r\n\x1a\n"
    with path.open("rb") as file:
        head = file.read(520)
    return head.startswith(signature) or head[512:] == signature


def _node(identifier: Any) -> Any:
    """Return the group or data set of an identifier, None for others."""
    if isinstance(identifier, h5d.DatasetID):
        return h5py.Dataset(identifier)
    return h5py.Group(identifier) if isinstance(identifier, h5g.GroupID) else None
