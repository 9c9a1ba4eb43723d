"""Malicious TDMS, netCDF, Parquet, universal and MDF files.

They have false sizes, circular references or formulas.
"""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from experiments.files.hostile_texts import Hostile
from experiments.files.seeds import SEEDS, N, T, X

_SECRET = "__import__('os').system('touch PWNED')"


def _changed(name: str, old: bytes, new: bytes, count: int = 1) -> Callable[[Path], object]:
    """Write an intact file and replace some of its bytes."""

    def write_it(path: Path) -> None:
        SEEDS[name](path)
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new, count))

    return write_it


def _cut(name: str, part: float) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        SEEDS[name](path)
        data = path.read_bytes()
        path.write_bytes(data[: int(part * len(data))])

    return write_it


def _parquet(metadata: dict[bytes, bytes], count: int = N, **columns: np.ndarray) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        table = pa.table({"t": np.arange(count) / 2000, "x": np.resize(X, count)} | columns)
        parquet.write_table(table.replace_schema_metadata(metadata), path, compression="gzip")

    return write_it


def _pandas(**about: object) -> dict[bytes, bytes]:
    return {b"pandas": json.dumps(about).encode()}


def _mdf(formula: str) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            file.append([Signal(1e6 * X, T, name="x", unit="um", conversion={"formula": formula})])
            file.save(path, overwrite=True)

    return write_it


def _circle(path: Path) -> None:
    """Write a group of channels that refers to itself as successor."""
    SEEDS["raster.mf4"](path)
    data = bytearray(path.read_bytes())
    place = data.index(b"##CG")
    data[place + 24 : place + 32] = struct.pack("<Q", place)
    path.write_bytes(data)


def _endless(path: Path) -> None:
    """Write packed data that grow to a hundred times their claimed size."""
    import zlib

    SEEDS["packed.mf4"](path)
    data = bytearray(path.read_bytes())
    place = data.index(b"##DZ")
    packed = zlib.compress(bytes(3 * 10**8), 9)
    size = struct.unpack_from("<Q", data, place + 40)[0]
    data[place + 40 : place + 48 + size] = struct.pack("<Q", len(packed)) + packed[:size]
    path.write_bytes(data)


def _swelling(path: Path) -> None:
    """Write a page that unpacks to 480 MB but claims 320 bytes."""
    import pyarrow as pa
    from pyarrow import parquet

    def table(count: int) -> bytes:
        sink = pa.BufferOutputStream()
        options = {"compression": "gzip", "use_dictionary": False, "data_page_size": 2**30, "max_rows_per_page": count}
        numbers = pa.table({"t": np.zeros(count), "x": np.zeros(count)})
        parquet.write_table(numbers, sink, row_group_size=count, write_statistics=False, **options)
        return sink.getvalue().to_pybytes()

    def varint(value: int) -> bytes:
        value, digits = 2 * value, bytearray()
        while value > 127:
            digits.append(value & 127 | 128)
            value >>= 7
        return bytes([*digits, value])

    count = 6 * 10**7
    data = table(count)
    place = len(data) - 8 - struct.unpack("<I", data[-8:-4])[0]
    footer = data[place:-8]
    assert varint(count) in footer
    # The smaller number keeps its number of digits, so that all offsets stay.
    for size in {count, *_sizes(footer, 8 * count)}:
        digits = len(varint(size))
        small = bytes([2 * N | 128, *[128] * (digits - 2), 0])
        footer = footer.replace(varint(size), small)
    path.write_bytes(data[:place] + footer + data[-8:])


def _sizes(footer: bytes, least: int) -> set[int]:
    """Find integers in a footer from `least` to 0.1 % above it."""
    found = set()
    for place in range(len(footer)):
        value = shift = 0
        for byte in footer[place : place + 9]:
            value, shift = value | (byte & 127) << shift, shift + 7
            if byte < 128:
                break
        if value % 2 == 0 and least <= value // 2 <= 1.001 * least:
            found.add(value // 2)
    return found


_HUGE = struct.pack("<Q", 2**40)
FORMATS: dict[str, Hostile] = {
    "count.tdms": (_changed("wave.tdms", struct.pack("<Q", N), _HUGE), "is cut off"),
    "cut.tdms": (_cut("wave.tdms", 0.5), "is cut off"),
    "interval.tdms": (
        _changed("wave.tdms", struct.pack("<d", 1 / 2000), struct.pack("<d", float("nan")), 9),
        "no time",
    ),
    "length.nc": (_changed("classic.nc", struct.pack(">I", N), struct.pack(">I", 2**31 - 1), 9), "."),
    "cut.nc": (_cut("classic.nc", 0.7), "."),
    "cut.parquet": (_cut("table.parquet", 0.9), "cannot be read as Parquet"),
    "secret.parquet": (_parquet({b"pandas": b"\x80\x04cos\nsystem\n.", b"ARROW:schema": b"!"}), "cannot be read as"),
    "attrs.parquet": (_parquet(_pandas(attributes={"units": {"x": _SECRET}})), "is not a known unit"),
    "units.parquet": (_parquet(_pandas(attributes={"units": ["x"]})), ""),
    "deep.parquet": (_parquet({b"pandas": b"[" * 100_000}), "cannot be read as Parquet"),
    "labels.parquet": (_parquet({}, 30_000, run=np.arange(30_000)), "changes its 'run' 30000 times"),
    "points.uff": (_changed("text.uff", b"        40", b"2000000000"), "declared to have|promises 2000000000"),
    "words.uff": (_changed("text.uff", b"e", b"x", 99), "."),
    "sets.uff": (lambda path: path.write_bytes(b"    -1\n    58\n    -1\n" * 20_000), "cannot be read as"),
    "circle.mf4": (_circle, "takes more than"),
    "formula.mf4": (_mdf(_SECRET), "no displacement"),
    "bomb.mf4": (_endless, "cannot be read as MDF|contradict their packing"),
    "cycles.mf4": (_changed("raster.mf4", struct.pack("<Q", N), _HUGE), ""),
}
FORMAT_BOMBS: dict[str, Hostile] = {
    "swelling.parquet": (_swelling, "more memory than plausible|not increasing"),
    "zeros.parquet": (
        _parquet({}, 3 * 10**7, t=np.zeros(3 * 10**7), x=np.zeros(3 * 10**7)),
        "more memory than plausible",
    ),
}
"""Files that unpack to far more than their size."""
