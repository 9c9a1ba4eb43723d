"""Writing a record so that reading it gives the same record: arrays to the last bit, facts and log included.

The file appears whole or not at all: it is written beside its place under a temporary name and then moved there.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ..show.files import whole
from .errors import UsageError
from .gather import record_of
from .native import MARK, SCHEMA, encode, to_text
from .record import Record


def write(record: Any, path: str | Path) -> Path:
    """Writes a record as `.csv` (text), `.npz` or `.h5`/`.hdf5` (CF units), never pickled.

    Args:
        record: what to write; a record, or whatever `fricjax.read` makes one of without options.
        path: where; the suffix chooses the format, an existing file is replaced.

    Returns:
        The path.

    Raises:
        UsageError: the suffix is none of these, or the folder does not exist.

    ```python
    fricjax.write((t, x), "run.h5")
    ```
    """
    record = record_of(record)
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise UsageError(
            f"A record cannot be written as '{path.suffix or path.name}'; use one of {', '.join(WRITERS)}."
        )
    if not path.parent.is_dir():
        raise UsageError(f"There is no folder {path.parent} to write {path.name} into; make it first.")
    with whole(path) as temporary:
        writer(record, temporary)
    return path


def _write_csv(record: Record, path: Path) -> None:
    path.write_text(to_text(record), encoding="utf-8")


def _write_npz(record: Record, path: Path) -> None:
    arrays, texts = encode(record)
    strings = {name: np.array(text) for name, text in texts.items()}
    np.savez_compressed(path, allow_pickle=False, **{MARK: np.array(SCHEMA)}, **strings, **arrays)


def _write_hdf5(record: Record, path: Path) -> None:
    import h5py

    arrays, texts = encode(record)
    with h5py.File(path, "w") as file:
        file.attrs.update({"Conventions": "CF-1.11", MARK: SCHEMA, **texts})
        nodes = {name: file.create_dataset(name, data=array) for name, array in arrays.items()}
        for name in nodes.keys() - {"mask"}:
            nodes[name].attrs["units"] = "s" if name == "t" else record.quantity
        nodes["t"].make_scale("t")
        nodes["x"].dims[0].attach_scale(nodes["t"])


WRITERS = {".csv": _write_csv, ".npz": _write_npz, ".h5": _write_hdf5, ".hdf5": _write_hdf5}
