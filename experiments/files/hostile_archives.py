"""Damaged or malicious numpy archives: false sizes, pickled objects, other content."""

import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.files.hostile_texts import Hostile
from experiments.files.seeds import N, T, X, record
from fricjax.data import write


class Touches:
    """An object that makes a file when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (open, ("PWNED", "w"))


def _packed(data: dict[str, bytes | np.ndarray], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", method) as archive:
        for name, content in data.items():
            archive.writestr(name, content if isinstance(content, bytes) else _npy(content))
    return target.getvalue()


def _npy(array: np.ndarray) -> bytes:
    target = io.BytesIO()
    np.save(target, array)
    return target.getvalue()


def _header(text: str, version: bytes = b"\x01\x00", data: bytes = X.tobytes()) -> bytes:
    head = text.encode("latin-1")
    return b"\x93NUMPY" + version + struct.pack("<H" if version[0] == 1 else "<I", len(head)) + head + data


def _with(name: str, content: bytes | np.ndarray, **options: Any) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(_packed({"t.npy": T, name: content}, **options))


def _described(
    shape: str = f"({N},)", kind: str = "'<f8'", order: str = "False", **options: Any
) -> Callable[[Path], object]:
    text = f"{{'descr': {kind}, 'fortran_order': {order}, 'shape': {shape}, }}"
    return _with("x.npy", _header(text, **options))


def _changed(change: Callable[[bytearray], object]) -> Callable[[Path], object]:
    def write_it(path: Path) -> None:
        data = bytearray(_packed({"t.npy": T, "x.npy": X}))
        change(data)
        path.write_bytes(data)

    return write_it


def _cut(end: float) -> Callable[[Path], object]:
    data = _packed({"t.npy": T, "x.npy": X})
    return lambda path: path.write_bytes(data[: int(end * len(data))])


def _directory(offset: int, code: str, value: int) -> Callable[[bytearray], object]:
    """Return a change of a number in the first directory entry."""
    return lambda data: struct.pack_into(code, data, data.index(b"PK\x01\x02") + offset, value)


def _own(**changes: Any) -> Callable[[Path], object]:
    """Write a fricjax record with some arrays replaced.

    None removes an array.
    """

    def write_it(path: Path) -> None:
        with np.load(write(record(), path)) as archive:
            arrays = {**archive, **changes}
        np.savez(path, **{name: np.asarray(value) for name, value in arrays.items() if value is not None})

    return write_it


def _twice(path: Path) -> None:
    data = _packed({"t.npy": T, "x.npy": X, "y.npy": X})
    path.write_bytes(data.replace(b"y.npy", b"x.npy"))


REFUSED = r"cannot be read as \.npz"
MEMORY = "needs more memory than plausible"
OWN = "claims to be a fricjax record, but it is damaged"

ARCHIVES: dict[str, Hostile] = {
    "array.npz": (lambda path: path.write_bytes(_npy(X)), "is a single array, not an archive"),
    "garbage.npz": (lambda path: path.write_bytes(b"garbage" * 99), REFUSED),
    "head.npz": (lambda path: path.write_bytes(b"PK\x03\x04" + bytes(99)), REFUSED),
    "pickle.npz": (lambda path: path.write_bytes(b"\x80\x04cos\nsystem\n(S'touch PWNED'\ntR."), REFUSED),
    "none.npz": (lambda path: path.write_bytes(_packed({})), "holds no arrays|" + REFUSED),
    "texts.npz": (lambda path: path.write_bytes(_packed({"a.txt": b"text"})), "holds no arrays"),
    "object.npz": (lambda path: np.savez(path, t=T, x=np.array([Touches()], object)), "pickled objects"),
    **{f"cut{i}.npz": (_cut(end), REFUSED) for i, end in enumerate((0.05, 0.3, 0.6, 0.9, 0.99))},
    "bit.npz": (_changed(lambda data: data.__setitem__(120, data[120] ^ 4)), REFUSED),
    "bits.npz": (_changed(lambda data: data.__setitem__(slice(200, 220), bytes(20))), REFUSED),
    "checksum.npz": (_changed(_directory(16, "<I", 1)), REFUSED),
    "claims.npz": (_changed(_directory(24, "<I", 0xFFFFFFF0)), ""),
    "method.npz": (_changed(_directory(10, "<H", 99)), REFUSED),
    "locked.npz": (_changed(_directory(8, "<H", 1)), REFUSED),
    "offset.npz": (_changed(_directory(42, "<I", 0x7FFFFFFF)), REFUSED),
    "bz2.npz": (_with("x.npy", X, method=zipfile.ZIP_BZIP2), ""),
    "lzma.npz": (_with("x.npy", X, method=zipfile.ZIP_LZMA), ""),
    "huge.npz": (_described("(1000000000000,)"), MEMORY),
    "product.npz": (_described("(4294967296, 4294967296)"), REFUSED),
    "bytes.npz": (_with("x.npy", np.zeros(2**25, "u1")), "more than plausible for a file of this size"),
    "negative.npz": (_described("(-40,)"), REFUSED),
    "short.npz": (_described(f"({N},)", data=b"1234"), REFUSED),
    "surplus.npz": (_described(f"({N},)", data=bytes(999)), ""),
    "nothing.npz": (_described("(1000000000000000,)", "'|V0'", data=b""), "holds no numbers"),
    "objects.npz": (_described(kind="'|O'"), "pickled objects"),
    "kind.npz": (_described(kind="'<q99'"), REFUSED),
    "code.npz": (_described("__import__('os').system('touch PWNED')"), REFUSED),
    "brackets.npz": (_described("(" * 9000), REFUSED),
    "power.npz": (_described("(9**9**9**9,)"), REFUSED),
    "digits.npz": (_described(f"({'9' * 5000},)"), REFUSED),
    "true.npz": (_described("(True,)"), REFUSED),
    "order.npz": (_described(order="'yes'"), REFUSED),
    "long.npz": (_described(" " * 60_000), "pickled objects"),
    "version3.npz": (_described(version=b"\x03\x00"), ""),
    "version9.npz": (_described(version=b"\x09\x00"), "no plain array|" + REFUSED),
    "headless.npz": (_with("x.npy", b""), REFUSED),
    "null.npz": (_with("x.npy", b"\x93NUMPY\x01\x00\xff\xff{}"), REFUSED),
    "twice.npz": (_twice, "several members"),
    "name.npz": (_with("x" * 500 + ".npy", X), ""),
    "escape.npz": (_with("\x1b[31mx.npy", X), ""),
    "traversal.npz": (_with("../../x.npy", X), ""),
    "many.npz": (
        lambda path: path.write_bytes(_packed(dict.fromkeys(map(str, range(20_000)), b""))),
        "holds no arrays",
    ),
    "own_schema.npz": (_own(fricjax_record="²"), "schema ²"),
    "own_digits.npz": (_own(fricjax_record="1" * 5000), "of schema 1111"),
    "own_later.npz": (_own(fricjax_record=7), "of schema 7"),
    "own_minus.npz": (_own(fricjax_record=-1), "of schema -1"),
    "own_list.npz": (_own(meta="[]"), OWN),
    "own_null.npz": (_own(meta="null"), OWN),
    "own_five.npz": (_own(meta="5"), OWN),
    "own_no_meta.npz": (_own(meta=None), OWN),
    "own_text.npz": (_own(meta="text"), OWN),
    "own_deep.npz": (_own(meta="[" * 90_000), "nested too deeply"),
    "own_number.npz": (_own(meta=f'{{"a": {"9" * 5000}}}'), OWN),
    "own_quantity.npz": (_own(meta='{"quantity": "furlong"}'), "'quantity' must be"),
    "own_unhashable.npz": (_own(meta='{"quantity": []}'), "'quantity' must be"),
    "own_release.npz": (_own(meta='{"release_time": "now"}'), "'release_time' must be"),
    "own_log.npz": (_own(log="5"), "'log' must be a list of steps"),
    "own_steps.npz": (_own(log="[1]"), "'log' must be a list of steps"),
    "own_step.npz": (_own(log=json.dumps([{"name": 1, "parameters": {}, "effect": ""}])), "'log' must be"),
    "own_parameters.npz": (_own(log=json.dumps([{"name": "a", "parameters": 1, "effect": ""}])), "'log' must be"),
    "own_complex.npz": (_own(x=X + 1j), "'x' holds complex numbers"),
    "own_words.npz": (_own(x=np.array(["a"] * N)), "'x' holds text"),
    "own_times.npz": (_own(t=T[::-1].copy()), "t must increase"),
    "own_mask.npz": (_own(mask=np.arange(N)), "'mask' holds other values"),
    "own_sigma.npz": (_own(sigma=-1.0), "sigma must be positive"),
    "own_shape.npz": (_own(x=np.zeros((N, 2))), "'x' has shape"),
    "own_no_x.npz": (_own(x=None), "'x' is missing"),
}
