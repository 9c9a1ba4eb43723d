"""Time `fricjax.read` relative to pandas and h5py.

    python experiments/benchmarks/reading.py [--rows 10000] [--repeats 100] [--files 1000]

For each file the script prints the shortest times of both readers in turn, in milliseconds, and their ratio. The last
row is the median for a folder of comma-separated files, each read once.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd

import fricjax as fj

TITLES = ("Time [s]", "Displacement [m]")
# Name of the file, delimiter and decimal mark.
TEXTS = (("comma.csv", ",", "."), ("tab.txt", "\t", "."), ("semicolon.csv", ";", ","))


def with_h5py(path: Path) -> list[np.ndarray]:
    with h5py.File(path) as file:
        return [np.asarray(file[title]) for title in ("t", "x")]


def write_texts(folder: Path, columns: np.ndarray) -> dict[Path, Callable[[], Any]]:
    """Write the text files; return the reader of pandas for each."""
    readers: dict[Path, Callable[[], Any]] = {}
    for name, delimiter, decimal in TEXTS:
        rows = [[f"{value:.9e}".replace(".", decimal) for value in row] for row in columns.T]
        path = folder / name
        path.write_text("\n".join(delimiter.join(row) for row in (TITLES, *rows)) + "\n")
        readers[path] = partial(pd.read_csv, path, sep=delimiter, decimal=decimal)
    return readers


def times_of(ours: Callable[..., Any], other: Callable[..., Any], calls: Iterable[tuple[Any, ...]]) -> np.ndarray:
    """Call both readers in turn; return their times [s], shape (2, calls)."""
    times = []
    for arguments in calls:
        for reader in (ours, other):
            begin = time.perf_counter()
            reader(*arguments)
            times.append(time.perf_counter() - begin)
    return np.reshape(times, (-1, 2)).T


def show(name: str, ours: float, other: float) -> None:
    print(f"{name:16}{1e3 * ours:9.2f}{1e3 * other:9.2f}{ours / other:7.2f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--files", type=int, default=1000)
    options = parser.parse_args()
    t = np.arange(options.rows) / 5e3
    columns = np.stack([t, 2e-3 * np.cos(80 * t) * np.exp(-t)])
    print(f"{'file':16}{'fricjax':>9}{'other':>9}{'ratio':>7}")
    with tempfile.TemporaryDirectory() as scratch:
        readers, hdf5 = write_texts(Path(scratch), columns), Path(scratch) / "run.h5"
        with h5py.File(hdf5, "w") as file:
            file["t"], file["x"] = columns
        for path, other in {**readers, hdf5: partial(with_h5py, hdf5)}.items():
            show(path.name, *times_of(partial(fj.read, path), other, [()] * options.repeats).min(axis=1))
        text = next(iter(readers)).read_text()
        paths = [Path(scratch) / f"{i:04}.csv" for i in range(options.files)]
        for path in paths:
            path.write_text(text)
        show("folder, each", *np.median(times_of(fj.read, pd.read_csv, [(path,) for path in paths]), axis=1))


if __name__ == "__main__":
    main()
