"""Malicious HDF5 and MATLAB files.

They have links to other places, circles, too many levels, or less content than they claim.
"""

import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from experiments.files.hostile_texts import Hostile
from experiments.files.seeds import SEEDS, N, T, X, record
from fricjax.data import write

REFUSED = "cannot be read as (HDF5|a MATLAB file)"
MEMORY = "more (memory )?than plausible|memory allocation failed"
CRASHES = "crashed"
SLOW = "takes more than"
# No data set except the times can be a displacement.
NONE = "no displacement|has 40 samples"


def _hdf5(build: Callable[[h5py.File], object], **options: Any) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        with h5py.File(path, "w", **options) as file:
            build(file)

    return write_it


def _beside(build: Callable[[h5py.File], object]) -> Callable[[Path], object]:
    """Write intact times together with other content."""
    return _hdf5(lambda file: (file.create_dataset("t", data=T), build(file)))


def _matlab73(build: Callable[[h5py.File], object]) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        _hdf5(lambda file: (file.create_dataset("t", data=T[None]), build(file)), userblock_size=512)(path)
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")

    return write_it


def _cells(file: h5py.File, depth: int, per_level: int) -> None:
    """Build nested cells that refer to the same cell several times.

    With depth zero the cells refer to themselves.
    """
    node = file.create_dataset("x", (per_level,), dtype=h5py.ref_dtype)
    node[:] = [node.ref] * per_level
    for i in range(depth):
        below, node = node, file.create_dataset(f"#refs#/{i}", (per_level,), dtype=h5py.ref_dtype)
        node[:] = [below.ref] * per_level
    if depth:
        file["x"][:] = [file.create_dataset("#refs#/end", data=X).ref] * per_level
        file["top"] = node


def _deep(file: h5py.File, levels: int) -> None:
    group = file["/"]
    for _ in range(levels):
        group = group.create_group("g")
    group["x"] = X


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((N,), "f8")
    layout[:] = h5py.VirtualSource("elsewhere.h5", "x", (N,))
    file.create_virtual_dataset("x", layout)


def _double_gzip(file: h5py.File) -> None:
    settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    settings.set_chunk((N,))
    settings.set_deflate(9), settings.set_deflate(9)
    space = h5py.h5s.create_simple((N,))
    made = h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, space, settings)
    h5py.Dataset(made)[:] = X


def _swelling(file: h5py.File, size: int) -> None:
    """Write a chunk of a few claimed numbers and `size` real bytes."""
    node = file.create_dataset("x", (N,), "f8", chunks=(N,), compression="gzip")
    node.id.write_direct_chunk((0,), zlib.compress(bytes(size), 9))


def _too_short(file: h5py.File) -> None:
    """Write a chunk shorter than its checksum."""
    node = file.create_dataset("x", (N,), "f8", chunks=(N,), fletcher32=True)
    node.id.write_direct_chunk((0,), b"1")


def _attribute(name: str, value: Any, **options: Any) -> Callable[[Path], object]:
    def build(file: h5py.File) -> None:
        file["x"] = X
        file["x"].attrs.create(name, value, **options)

    return _beside(build)


def _own(**attributes: Any) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        with h5py.File(write(record(), path), "r+") as file:
            file.attrs.update(attributes)

    return write_it


def _heap(change: Callable[[bytearray, int], object]) -> Callable[[Path], object]:
    """Write a fricjax record with texts in a damaged heap."""

    def write_it(path: Path) -> None:
        data = bytearray(write(record(), path).read_bytes())
        change(data, data.index(b"GCOL"))
        path.write_bytes(data)

    return write_it


def _cut(seed: str, end: float) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        SEEDS[seed](path)
        data = path.read_bytes()
        path.write_bytes(data[: int(end * len(data))])

    return write_it


HDF5: dict[str, Hostile] = {
    "garbage.h5": (lambda path: path.write_bytes(b"garbage" * 99), REFUSED),
    "netcdf3.nc": (lambda path: path.write_bytes(b"CDF\x01" + bytes(99)), "holds no variable of numbers"),
    **{f"cut{i}.h5": (_cut("plain.h5", end), REFUSED) for i, end in enumerate((0.01, 0.2, 0.5, 0.9))},
    "empty_file.h5": (_hdf5(lambda file: None), "holds no data set"),
    "soft.h5": (_beside(lambda file: file.__setitem__("x", h5py.SoftLink("/x"))), NONE),
    "soft_there.h5": (_beside(lambda file: file.__setitem__("x", h5py.SoftLink("/t"))), NONE),
    "external.h5": (
        _beside(lambda file: file.__setitem__("x", h5py.ExternalLink("/etc/passwd", "/"))),
        NONE,
    ),
    "circle.h5": (_beside(lambda file: (file.__setitem__("g", file["/"]), file.__setitem__("x", X))), ""),
    "deep.h5": (_hdf5(lambda file: _deep(file, 3000)), "has no time"),
    "many.h5": (_hdf5(lambda file: [file.create_group(str(i)) for i in range(10_001)]), "holds no data set"),
    "virtual.h5": (_beside(_virtual), "lies in another file"),
    "storage.h5": (
        _beside(lambda file: file.create_dataset("x", (N,), "u1", external=[("/etc/passwd", 0, N)])),
        "lies in another file",
    ),
    "huge.h5": (_beside(lambda file: file.create_dataset("x", (10**15,), "f8", chunks=(1000,))), MEMORY),
    "contiguous.h5": (_beside(lambda file: file.create_dataset("x", (10**9,), "f8")), MEMORY),
    "chunk.h5": (_beside(lambda file: file.create_dataset("x", (N,), "f8", chunks=(2**28,), maxshape=(None,))), ""),
    "pieces.h5": (_beside(lambda file: file.create_dataset("x", (10**6,), "u1", chunks=(1,))), f"{MEMORY}|{SLOW}"),
    "scale_offset.h5": (_beside(lambda file: file.create_dataset("x", data=np.arange(N), scaleoffset=0)), ""),
    "double.h5": (_beside(_double_gzip), ""),
    "swells.h5": (_beside(lambda file: _swelling(file, 10**6)), ""),
    "shrinks.h5": (_beside(lambda file: _swelling(file, 100)), ""),
    "too_short.h5": (_beside(_too_short), CRASHES),
    "length.h5": (_beside(lambda file: file.create_dataset("x", (3,), h5py.vlen_dtype(float))), NONE),
    "words.h5": (_beside(lambda file: file.__setitem__("x", ["a"] * N)), NONE),
    "null.h5": (_beside(lambda file: file.create_dataset("x", data=h5py.Empty("f8"))), NONE),
    "zero.h5": (_beside(lambda file: file.__setitem__("x", X[:0])), "is empty, so it is no displacement"),
    "compound.h5": (_beside(lambda file: file.__setitem__("x", np.zeros(N, "f8,i4"))), NONE),
    "complex.h5": (_beside(lambda file: file.__setitem__("x", X + 1j)), NONE),
    "unit_bytes.h5": (_attribute("units", np.bytes_(b"\xff\xfe\x00m")), "is not a known unit"),
    "unit_long.h5": (_attribute("units", "m" * 9999), "is not a known unit"),
    "unit_bomb.h5": (_attribute("units", "9**9**9**9**9 m"), "is not a known unit"),
    "unit_list.h5": (_attribute("units", ["m"] * 3), ""),
    "unit_none.h5": (_attribute("units", h5py.Empty("S1")), ""),
    "unit_number.h5": (_attribute("units", 5.0), "is not a known unit"),
    "scale_text.h5": (_attribute("scale_factor", "text"), "scale_factor or add_offset of '/x'"),
    "scale_nan.h5": (_attribute("scale_factor", np.nan), "usable samples"),
    "fill_none.h5": (_attribute("_FillValue", np.zeros(0)), ""),
    "fill_text.h5": (_attribute("_FillValue", "text"), ""),
    "fill_many.h5": (_attribute("_FillValue", np.zeros(5000)), ""),
    "heap_zero.h5": (_heap(lambda data, at: data.__setitem__(slice(at + 16, at + 32), bytes(16))), SLOW),
    "heap_size.h5": (_heap(lambda data, at: struct.pack_into("<Q", data, at + 24, 2**64 - 16)), SLOW),
    "heap_end.h5": (_heap(lambda data, at: struct.pack_into("<Q", data, at + 8, 2**40)), REFUSED),
    "own_list.h5": (_own(meta="[]"), "'meta' must be an object"),
    "own_five.h5": (_own(meta=5), "'meta' must be an object"),
    "own_none.h5": (_own(meta=h5py.Empty("S1")), "'meta' is no JSON"),
    "own_deep.h5": (_own(meta="[" * 20_000), "nested too deeply"),
    "own_schema.h5": (_own(fricjax_record="²"), "schema ²"),
    "own_digits.h5": (_own(fricjax_record="1" * 5000), "schema 1111"),
    "own_real.h5": (_own(fricjax_record=1.5), "schema 1.5"),
}


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<2I", kind, len(data)) + data + bytes(-len(data) % 8)


def _matrix(kind: int, shape: tuple[int, ...], content: bytes, name: bytes = b"x") -> bytes:
    """Build a variable of a version 5 file.

    It has flags, dimensions, name and content.
    """
    head = _element(6, struct.pack("<2I", kind, 0)) + _element(5, struct.pack(f"<{len(shape)}i", *shape))
    return _element(14, head + _element(1, name) + content)


def _v5(*parts: bytes) -> Callable[[Path], object]:
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + b"\x00\x01IM"
    time = _matrix(6, (N, 1), _element(9, T.tobytes()), b"t")
    return lambda path: path.write_bytes(head + time + b"".join(parts))


def matlab_of(kind: int, text: bytes) -> Callable[[Path], object]:
    """Write a version 5 file with a variable of class `kind`.

    The variable contains a text. Class 16 is a function handle, class 17 an object.
    """
    return _v5(_matrix(kind, (1, 1), _matrix(4, (1, len(text)), _element(2, text))))


def _nested(levels: int) -> bytes:
    # Building from the inside out would copy the inner part at each level.
    inner = _matrix(6, (1, 1), _element(9, bytes(8)), b"")
    size, heads = len(inner), []
    for _ in range(levels):
        head = _element(6, struct.pack("<2I", 1, 0)) + _element(5, struct.pack("<2i", 1, 1)) + _element(1, b"")
        size += len(head) + 8
        heads.append(struct.pack("<2I", 14, size - 8) + head)
    return b"".join([*reversed(heads), inner])


def _packed(data: bytes) -> bytes:
    packed = zlib.compress(data, 9)
    return struct.pack("<2I", 15, len(packed)) + packed


def _v4(rows: int, columns: int, kind: int = 0, data: bytes = X.tobytes()) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(struct.pack("<5i", kind, rows, columns, 0, 2) + b"x\x00" + data)


MATLAB: dict[str, Hostile] = {
    "garbage.mat": (lambda path: path.write_bytes(b"garbage" * 99), REFUSED),
    "short.mat": (lambda path: path.write_bytes(b"MATLAB"), REFUSED),
    **{f"cut5_{i}.mat": (_cut("v5.mat", end), REFUSED) for i, end in enumerate((0.1, 0.3, 0.6, 0.95))},
    **{f"cut7_{i}.mat": (_cut("v73.mat", end), REFUSED) for i, end in enumerate((0.2, 0.6, 0.9))},
    **{f"cut4_{i}.mat": (_cut("v4.mat", end), REFUSED) for i, end in enumerate((0.2, 0.9))},
    "packed_cut.mat": (_v5(_packed(_matrix(6, (N, 1), _element(9, X.tobytes())))[:-9]), REFUSED),
    "packed_bits.mat": (_v5(struct.pack("<2I", 15, 64) + b"\x78\x9c" + b"\xff" * 62), REFUSED),
    "packed_twice.mat": (_v5(_packed(_packed(_matrix(6, (N, 1), _element(9, X.tobytes()))))), REFUSED),
    "nested.mat": (_v5(_nested(50_000)), CRASHES),
    "nested_packed.mat": (_v5(_packed(_nested(50_000))), CRASHES),
    "cells.mat": (_v5(_matrix(1, (2**30, 1), b"")), MEMORY),
    "structs.mat": (_v5(_matrix(2, (2**30, 1), _element(5, struct.pack("<i", 8)) + _element(1, b"a" * 8))), MEMORY),
    "numbers.mat": (_v5(_matrix(6, (2**30, 2**30), _element(9, X.tobytes()))), REFUSED),
    "blanks.mat": (_v5(_matrix(4, (1, 2**30), _element(16, b""))), MEMORY),
    "minus.mat": (_v5(_matrix(6, (-1, -40), _element(9, X.tobytes()))), REFUSED),
    "no_flags.mat": (_v5(_element(14, _element(5, bytes(8)) * 4)), REFUSED),
    "hidden.mat": (_v5(_element(14, _element(6, bytes(800)))), REFUSED),
    "beyond.mat": (_v5(struct.pack("<2I", 14, 2**31)), REFUSED),
    "nothing.mat": (_v5(struct.pack("<2I", 14, 0)), REFUSED),
    "kind.mat": (_v5(_matrix(99, (N, 1), _element(9, X.tobytes()))), REFUSED),
    "inner.mat": (_v5(_matrix(6, (N, 1), struct.pack("<2I", 9, 2**30))), REFUSED),
    "minus4.mat": (_v4(-40, 1), REFUSED),
    "back4.mat": (_v4(-1, 42), REFUSED),
    "huge4.mat": (_v4(2**30, 2**30), REFUSED),
    "sparse_minus4.mat": (_v4(N, 1, kind=99999), REFUSED),
    "circle73.mat": (_matlab73(lambda file: _cells(file, 0, 1)), REFUSED),
    "tree73.mat": (_matlab73(lambda file: _cells(file, 22, 2)), NONE),
    "wide73.mat": (_matlab73(lambda file: _cells(file, 3, 1000)), NONE),
    "root73.mat": (_matlab73(lambda file: file.attrs.update(MATLAB_sparse=5, MATLAB_object_decode=3)), NONE),
    "soft73.mat": (_matlab73(lambda file: file.__setitem__("x", h5py.SoftLink("/x"))), NONE),
    "group73.mat": (_matlab73(lambda file: file.__setitem__("x", file["/"])), REFUSED),
    "external73.mat": (_matlab73(lambda file: file.__setitem__("x", h5py.ExternalLink("/etc/passwd", "/"))), NONE),
    "huge73.mat": (_matlab73(lambda file: file.create_dataset("x", (1, 10**12), "f8", chunks=(1, 10**4))), MEMORY),
    "null73.mat": (_matlab73(lambda file: file.create_dataset("x", (3,), dtype=h5py.ref_dtype)), "refers to nothing"),
    "words73.mat": (_matlab73(lambda file: file.__setitem__("x", "text")), NONE),
}


def _long_line(field: str) -> Callable[[Path], object]:
    """Write a text of fifty million fields in one line."""
    return lambda path: path.write_text(field * 50_000_000)


def _zipped(name: str, size: int) -> Callable[[Path], object]:
    """Write an archive of one member full of zeros."""

    def write_it(path: Path) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open(name, "w") as part:
            for _ in range(size >> 24):
                part.write(bytes(2**24))

    return write_it


def _rows(path: Path) -> None:
    """Write a workbook with millions of rows in a few kilobytes."""
    SEEDS["book.xlsx"](path)
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    # With the size of the table the library would stop at its last row.
    sheet = re.sub(rb"<dimension[^>]*/>", b"", parts["xl/worksheets/sheet1.xml"])
    end = sheet.index(b"</sheetData>")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            if name == "xl/worksheets/sheet1.xml":
                part = sheet[:end] + b"<row><c><v>1</v></c></row>" * 10**7 + sheet[end:]
            archive.writestr(name, part)


BOMBS: dict[str, Hostile] = {
    "columns.csv": (_long_line("1,"), "fields|a line of more than 1 MB"),
    "blanks.txt": (_long_line("1 "), "a line of more than 1 MB"),
    "word.csv": (_long_line("a"), "a line of more than 1 MB"),
    "bomb.xlsx": (_zipped("xl/worksheets/sheet1.xml", 2**30), "cannot be read as .xlsx"),
    "rows.xlsx": (_rows, SLOW),
    "bomb.h5": (
        _beside(
            lambda file: file.create_dataset("x", (2**31,), "u1", chunks=(2**24,), compression="gzip", fillvalue=0)
        ),
        MEMORY,
    ),
    "chunk_bomb.h5": (_beside(lambda file: _swelling(file, 3 * 10**8)), ""),
    "bomb73.mat": (_matlab73(lambda file: file.create_dataset("x", (1, 2**30), "f8", chunks=(1, 2**20))), MEMORY),
    "bomb5.mat": (_v5(_packed(_matrix(6, (2**25, 1), _element(9, bytes(2**28))))), MEMORY),
    "bytes.h5": (
        _beside(lambda file: file.create_dataset("x", (2**26,), "u1", chunks=(2**24,), compression="gzip")),
        MEMORY,
    ),
    "bytes5.mat": (_v5(_packed(_matrix(9, (2**26, 1), _element(2, bytes(2**26))))), MEMORY),
    "large5.mat": (lambda path: (_v5()(path), _lengthen(path, 2**33)), "save time and displacement"),
    "sparse.h5": (lambda path: (SEEDS["plain.h5"](path), _lengthen(path, 2**40)), ""),
    "sparse4.mat": (lambda path: (_v4(2**30, 1)(path), _lengthen(path, 2**33 + 22)), "save time and displacement"),
}


def _lengthen(path: Path, size: int) -> None:
    with path.open("r+b") as file:
        file.truncate(size)
