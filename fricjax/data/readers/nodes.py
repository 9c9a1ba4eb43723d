"""HDF5 files of unknown origin: what lies in the file itself and is not larger than plausible, and nothing else.

Only hard links are followed, for soft and external ones lead anywhere, and storage in other files is refused. Sizes are
declared apart from the data, chunks may be packed a thousandfold, and several may lie in one place; all that is looked
at before the library reads, since its own buffers grow without a bound.
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
"""Levels of groups below which nothing is looked for."""
MOST = 10_000
"""Groups and data sets that are looked at."""
# Chunks of one data set: ten million samples in chunks of a hundred. More of them take seconds to be found.
_CHUNKS = 200_000
_DEFLATE, _FLETCHER = 1, 3
# The library's filters that give back as much as is packed says; n-bit and scale-offset trust their parameters.
_UNSAFE_FILTERS = (5, 6)
# By how much a packed chunk may exceed the unpacked one: a thousandth, and headers.
_SLACK = 1024
_ATTRIBUTE = 64  # entries of the longest attribute that is read
# How a collection of texts of any length begins: its signature, its version, and three bytes of nothing. Its size
# follows, and then one text after the other, each behind its number, its references, four bytes and its size.
# They are looked for where a file begins, for texts are written before long traces; all of a file could take minutes.
_SCANNED = 1 << 28
_HEAP, _HEAP_HEAD, _TEXT_HEAD = b"GCOL\x01\0\0\0", 16, 16


class NotRead(DataError):
    """A data set that is not read, for a `reason` that follows "it is not read: "."""

    def __init__(self, place: str, reason: str) -> None:
        super().__init__(f"{place} is not read: {reason}.")
        self.reason = reason


class Tree:
    """An open file.

    Attributes:
        path: where it lies.
        file: its root group, of h5py.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file = path, file
        self._left, self._looked_at, self._heaps_are_sound = allowance(path), 0, False

    def children(self, group: Any) -> dict[str, Any]:
        """Groups and data sets that lie in a group by hard links, by name.

        Raises:
            DataError: there are more than `MOST` in all.
        """
        from h5py import h5l, h5o  # pyright: ignore[reportAttributeAccessIssue]

        self._looked_at += group.id.get_num_objs()
        if self._looked_at > MOST:
            raise DataError(f"{self.path.name} has more than {MOST} groups and data sets; save one run in a file.")
        hard = [name for name in group.id if group.id.links.get_info(name).type == h5l.TYPE_HARD]
        nodes = {name.decode("utf-8", "replace"): _node(h5o.open(group.id, name)) for name in hard}
        return {name: node for name, node in nodes.items() if node is not None}

    def referred(self, reference: Any) -> Any:
        """The group or data set of this file that a reference names; None where it names none."""
        from h5py import h5r  # pyright: ignore[reportAttributeAccessIssue]

        return _node(h5r.dereference(reference, self.file.id))

    def data_sets(self) -> dict[str, Any]:
        """All data sets by path, such as `"/run1/x"`; each group is visited once."""
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
        """Why a data set is not read, None where it is."""
        import h5py
        from h5py import h5t  # pyright: ignore[reportAttributeAccessIssue]

        if node.is_virtual or node.external:
            return "its data lie in another file, which is not opened"
        if node.dtype.hasobject and h5py.check_ref_dtype(node.dtype) is None:
            return "it holds texts or lists of varying length"
        # Numbers whose sign or exponent lies elsewhere, as damaged types say, are converted beyond their memory.
        if not node.dtype.hasobject and not h5t.py_create(node.dtype, logical=True).equal(node.id.get_type()):
            return "its numbers are of no usual type"
        chunks = 0 if node.chunks is None else _positions(node) * _bytes(node.chunks, node.dtype)
        size = max(_bytes(node.shape or (), node.dtype), chunks)
        if size > self._left:
            return f"it is declared to have {gigabytes(size)}, more than plausible for a file of this size"
        return None if node.chunks is None else _unsafe_chunks(node)

    def read(self, node: Any) -> np.ndarray:
        """The content of a data set.

        Raises:
            NotRead: it is not to be read.
        """
        reason = self._refusal(node)
        if reason is not None:
            raise NotRead(f"'{node.name}' in {self.path.name}", reason)
        value = np.asarray(node[()]) if node.shape is not None else np.zeros(0)
        self._left -= value.nbytes
        return value

    def attribute(self, node: Any, name: str, default: Any = None) -> Any:
        """A number or text beside a group or a data set; texts are decoded, and of several entries the first counts."""
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
        """Path of the data set that holds the places along the first dimension, by the convention of netCDF."""
        from h5py import h5a  # pyright: ignore[reportAttributeAccessIssue]

        if not h5a.exists(node.id, b"DIMENSION_LIST"):
            return None
        self._check_heaps()
        scales = node.dims[0]
        return scales[0].name if len(scales) else None

    def _check_heaps(self) -> None:
        """Refuses a file whose texts of any length lie in damaged collections, for over some the library never ends."""
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
    """The file while the block lasts, in which whatever the library cannot read becomes a `DataError`."""
    import h5py

    with damage(path, kind), h5py.File(path, "r") as file:
        yield Tree(path, file)


def _sound_heap(data: bytes, place: int) -> bool:
    """Whether the texts of a collection lie in it one after the other; the room behind them has the number zero."""
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
    """A group or data set by its identifier; None for what is neither."""
    from h5py import Dataset, Group, h5d, h5g  # pyright: ignore[reportAttributeAccessIssue]

    if isinstance(opened, h5d.DatasetID):
        return Dataset(opened)
    return Group(opened) if isinstance(opened, h5g.GroupID) else None


def _bytes(shape: tuple[int, ...], dtype: np.dtype) -> int:
    """What an array takes as part of a record."""
    return math.prod(shape) * max(dtype.itemsize, NUMBER)


def _positions(node: Any) -> int:
    """How many chunks cover a data set."""
    return math.prod(-(-extent // chunk) for extent, chunk in zip(node.shape, node.chunks, strict=True))


def _unsafe_chunks(node: Any) -> str | None:
    """Why the chunks of a data set are not to be unpacked, None where they are what they claim to be."""
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
        # A checksum that is taken before the packing is packed as well.
        size += 4 * filters[:at].count(_FLETCHER)
        if any(not _unpacks(node, place, at, size) for place in places):
            return "its chunks are not of the size that they claim"
    return None


def _unpacks(node: Any, place: Any, at: int, size: int) -> bool:
    """Whether a chunk that is packed by the filter number `at` unpacks to so many bytes."""
    skipped, packed = node.id.read_direct_chunk(place.chunk_offset)
    return bool(skipped >> at & 1) or len(zlib.decompressobj().decompress(packed, size + 1)) == size
