"""Writing of records.

Reading the file restores the record exactly, with metadata and log. The file appears only when it is complete, and
replaces an existing file only with `overwrite`.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UsageError, path_of
from ..show.files import write_bytes
from .gather import record_of
from .native import MARK, SCHEMA, encode, to_text
from .record import Record


def write(record: Any, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write a record as `.csv` (text), `.npz` or `.h5`/`.hdf5` (CF units).

    Nothing is pickled.

    Args:
        record: a record, or any source that `fricjax.read` accepts without options.
        path: the file to write; the suffix selects the format.
        overwrite: replace an existing file.

    Returns:
        The path.

    Raises:
        UsageError: an unsupported suffix, or a missing folder.
        FileExistsError: the file exists, and `overwrite` is not set.
        OSError: the file cannot be written, for example on a full disk; an existing file is unchanged.

    Examples:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = fj.write(record, Path(folder) / "run.npz")
        ...     bool((fj.read(path).x == record.x).all())
        True
    """
    record = record_of(record)
    path = path_of(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise UsageError(
            f"A record cannot be written as '{path.suffix or path.name}'; use one of {', '.join(WRITERS)}."
        )
    if not path.parent.is_dir():
        raise UsageError(f"There is no folder {path.parent} to write {path.name} into; make it first.")
    return write_bytes(path, writer(record), overwrite=overwrite)


def _npz(record: Record) -> memoryview:
    arrays, texts = encode(record)
    strings = {name: np.array(text) for name, text in texts.items()}
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **{MARK: np.array(SCHEMA)}, **strings, **arrays)
    return file.getbuffer()


def _hdf5(record: Record) -> memoryview:
    import h5py

    arrays, texts = encode(record)
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file.attrs.update({"Conventions": "CF-1.11", MARK: SCHEMA, **texts})
        nodes = {name: file.create_dataset(name, data=array) for name, array in arrays.items()}
        for name, node in nodes.items():
            if name != "mask":
                node.attrs["units"] = "s" if name == "t" else record.quantity
        nodes["t"].make_scale("t")
        nodes["x"].dims[0].attach_scale(nodes["t"])
    return content.getbuffer()


WRITERS = {".csv": lambda record: to_text(record).encode("utf-8"), ".npz": _npz, ".h5": _hdf5, ".hdf5": _hdf5}
