"""Safe access to HDF5 files of unknown origin.

Only hard links are followed, because soft and external links can lead anywhere, and external storage is refused. Sizes
are declared apart from the data, chunks may be packed a thousandfold, and several may share a position. All of this is
checked before the library reads, because its buffers grow without bound.
"""

import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ..files import NUMBER, allowance, damage, gigabytes

DEEPEST = 32
"""Deepest level of nested groups to search."""
MOST = 10_000
"""Largest number of groups and data sets."""
# Largest number of chunks in a data set: ten million samples in chunks of a hundred. Finding more takes seconds.
_CHUNKS = 200_000
_DEFLATE, _FLETCHER = 1, 3
# Filters n-bit and scale-offset: the library trusts their parameters on the unpacked size.
_UNSAFE_FILTERS = (5, 6)
# Largest excess of a packed chunk over the unpacked one: a thousandth, plus headers.
_SLACK = 1024
_ATTRIBUTE = 64  # largest number of entries in an attribute
# First bytes of a collection of variable-length texts: signature, version, and three zero bytes. The size follows, and
# then the texts. Each text has a head with its number, its references, four bytes and its size. Only the beginning of a
# file is searched, because texts precede long traces; searching a large file completely could take minutes.
_SCANNED = 1 << 28
_HEAP, _HEAP_HEAD, _TEXT_HEAD = b"GCOL\x01\0\0\0", 16, 16


class NotRead(DataError):
    """A data set was refused; `reason` completes "it is not read: "."""

    def __init__(self, place: str, reason: str) -> None:
        super().__init__(f"{place} is not read: {reason}.")
        self.reason = reason


class Tree:
    """An open HDF5 file.

    Attributes:
        path: path of the file.
        file: its root group, from h5py.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file = path, file
        self._left, self._looked_at, self._heaps_are_sound = allowance(path), 0, False

    def children(self, group: Any) -> dict[str, Any]:
        """Return the groups and data sets in a group, by name.

        Only hard links are followed.

        Raises:
            DataError: the file has more than `MOST` nodes in total.
        """
        from h5py import h5l, h5o  # pyright: ignore[reportAttributeAccessIssue]

        self._looked_at += group.id.get_num_objs()
        if self._looked_at > MOST:
            raise DataError(f"{self.path.name} has more than {MOST} groups and data sets; save one run in a file.")
        hard = [name for name in group.id if group.id.links.get_info(name).type == h5l.TYPE_HARD]
        nodes = {name.decode("utf-8", "replace"): _node(h5o.open(group.id, name)) for name in hard}
        return {name: node for name, node in nodes.items() if node is not None}

    def referred(self, reference: Any) -> Any:
        """Return the node of a reference, None if there is none."""
        from h5py import h5r  # pyright: ignore[reportAttributeAccessIssue]

        return _node(h5r.dereference(reference, self.file.id))

    def data_sets(self) -> dict[str, Any]:
        """Return all data sets by path, such as `"/run1/x"`.

        Each group is visited once.
        """
        from h5py import Group, h5o  # pyright: ignore[reportAttributeAccessIssue]

        data_sets: dict[str, Any] = {}
        waiting, seen = [("", self.file["/"], 0)], set()
        while waiting:
            folder, group, depth = waiting.pop(0)
            address = h5o.get_info(group.id).addr
            if address in seen:
                continue
            seen.add(address)
            if depth > DEEPEST:
                raise DataError(f"{self.path.name} has groups nested more than {DEEPEST} deep; save one run in a file.")
            for name, node in self.children(group).items():
                if isinstance(node, Group):
                    waiting.append((f"{folder}/{name}", node, depth + 1))
                else:
                    data_sets[f"{folder}/{name}"] = node
        return data_sets

    def _refusal(self, node: Any) -> str | None:
        """Return why a data set is refused, None if it is readable."""
        import h5py
        from h5py import h5t  # pyright: ignore[reportAttributeAccessIssue]

        if node.is_virtual or node.external:
            return "its data lie in another file, which is not opened"
        if node.dtype.hasobject and h5py.check_ref_dtype(node.dtype) is None:
            return "it holds texts or lists of varying length"
        # A damaged type with sign or exponent at other places would be converted beyond its memory.
        if not node.dtype.hasobject and not h5t.py_create(node.dtype, logical=True).equal(node.id.get_type()):
            return "its numbers are of no usual type"
        chunks = 0 if node.chunks is None else _positions(node) * _bytes(node.chunks, node.dtype)
        size = max(_bytes(node.shape or (), node.dtype), chunks)
        if size > self._left:
            return f"it is declared to have {gigabytes(size)}, more than plausible for a file of this size"
        return None if node.chunks is None else _unsafe_chunks(node)

    def read(self, node: Any) -> np.ndarray:
        """Return the content of a data set.

        Raises:
            NotRead: the data set is refused.
        """
        reason = self._refusal(node)
        if reason is not None:
            raise NotRead(f"'{node.name}' in {self.path.name}", reason)
        value = np.asarray(node[()]) if node.shape is not None else np.zeros(0)
        self._left -= value.nbytes
        return value

    def attribute(self, node: Any, name: str, default: Any = None) -> Any:
        """Return a numeric or text attribute of a node.

        Texts are decoded; an array is reduced to its first entry.
        """
        from h5py import h5a  # pyright: ignore[reportAttributeAccessIssue]

        if not h5a.exists(node.id, name.encode()):
            return default
        stored = node.attrs.get_id(name)
        if stored.shape is None or not 0 < math.prod(stored.shape) <= _ATTRIBUTE:
            return default
        if stored.dtype.hasobject:
            self._check_heaps()
        value = np.ravel(np.asarray(node.attrs[name], dtype=object))[0]
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else value

    def scale(self, node: Any) -> str | None:
        """Return the path of the first dimension's coordinates.

        This follows the convention of netCDF.
        """
        from h5py import h5a  # pyright: ignore[reportAttributeAccessIssue]

        if not h5a.exists(node.id, b"DIMENSION_LIST"):
            return None
        self._check_heaps()
        scales = node.dims[0]
        return scales[0].name if len(scales) else None

    def _check_heaps(self) -> None:
        """Refuse a file with damaged collections of variable-length texts.

        On some of them the library never returns.
        """
        if not self._heaps_are_sound:
            with self.path.open("rb") as file:
                data = file.read(_SCANNED)
            place = data.find(_HEAP)
            while place >= 0:
                if not _sound_heap(data, place):
                    raise DataError(f"{self.path.name} is damaged: the texts at byte {place} do not fit; try h5repack.")
                place = data.find(_HEAP, place + 1)
            self._heaps_are_sound = True


@contextmanager
def opened(path: Path, kind: str = "HDF5") -> Iterator[Tree]:
    """Open a file as a context; errors of the library become `DataError`."""
    import h5py

    with damage(path, kind), h5py.File(path, "r") as file:
        yield Tree(path, file)


def _sound_heap(data: bytes, place: int) -> bool:
    """Return True if the texts of a collection follow each other.

    The free space after them has the number zero.
    """
    end = place + int.from_bytes(data[place + 8 : place + _HEAP_HEAD], "little")
    place += _HEAP_HEAD
    while place + _TEXT_HEAD <= min(end, len(data)):
        number = int.from_bytes(data[place : place + 2], "little")
        size = int.from_bytes(data[place + 8 : place + _TEXT_HEAD], "little")
        step = size if number == 0 else _TEXT_HEAD + size + -size % 8
        if step < _TEXT_HEAD or place + step > end:
            return False
        place += step
    return end <= len(data) or len(data) == _SCANNED


def _node(opened: Any) -> Any:
    """Return the group or data set of an identifier, None for others."""
    from h5py import Dataset, Group, h5d, h5g  # pyright: ignore[reportAttributeAccessIssue]

    if isinstance(opened, h5d.DatasetID):
        return Dataset(opened)
    return Group(opened) if isinstance(opened, h5g.GroupID) else None


def _bytes(shape: tuple[int, ...], dtype: np.dtype) -> int:
    """Return the size of an array in a record [bytes]."""
    return math.prod(shape) * max(dtype.itemsize, NUMBER)


def _positions(node: Any) -> int:
    """Return the number of chunks that cover a data set."""
    return math.prod(-(-extent // chunk) for extent, chunk in zip(node.shape, node.chunks, strict=True))


def _unsafe_chunks(node: Any) -> str | None:
    """Return why chunks must not be unpacked, None if they may."""
    if _positions(node) > _CHUNKS:
        return f"it lies in more than {_CHUNKS} pieces; write it again in larger chunks"
    settings = node.id.get_create_plist()
    filters = [settings.get_filter(i)[0] for i in range(settings.get_nfilters())]
    if set(filters) & set(_UNSAFE_FILTERS) or filters.count(_DEFLATE) > 1:
        return "it is packed in an unusual way; write it again with gzip"
    places: list[Any] = []
    node.id.chunk_iter(places.append)
    size = math.prod(node.chunks) * node.dtype.itemsize
    if len({place.byte_offset for place in places}) < len(places):
        return "several of its chunks lie in one place"
    if any(not 4 * filters.count(_FLETCHER) < place.size <= size + size // 1000 + _SLACK for place in places):
        return "its chunks are larger packed than unpacked, or hold nothing"
    if _DEFLATE in filters:
        at = filters.index(_DEFLATE)
        if set(filters[at + 1 :]) - {_FLETCHER}:
            return "it is packed in an unusual way; write it again with gzip"
        # A checksum taken before the packing is packed as well.
        size += 4 * filters[:at].count(_FLETCHER)
        if any(not _unpacks(node, place, at, size) for place in places):
            return "its chunks are not of the size that they claim"
    return None


def _unpacks(node: Any, place: Any, at: int, size: int) -> bool:
    """Return True if a chunk unpacks to `size` bytes.

    The filter at index `at` has packed it.
    """
    skipped, packed = node.id.read_direct_chunk(place.chunk_offset)
    return bool(skipped >> at & 1) or len(zlib.decompressobj().decompress(packed, size + 1)) == size
