"""Time `fricjax.read` relative to pandas and h5py.

    python experiments/benchmarks/reading.py [--rows 10000] [--repeats 100] [--files 1000]

For each file the script prints the shortest times of both readers in turn, in milliseconds, and their ratio. The last
row is a folder of comma-separated files, each read once.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
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


def shortest(readers: list[Callable[[], Any]], repeats: int) -> list[float]:
    """Return the shortest time of each reader [s], called in turn."""
    times = [[] for _ in readers]
    for _ in range(repeats):
        for reader, seconds in zip(readers, times, strict=True):
            begin = time.perf_counter()
            reader()
            seconds.append(time.perf_counter() - begin)
    return [min(seconds) for seconds in times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--files", type=int, default=1000)
    options = parser.parse_args()
    t = np.arange(options.rows) / 5e3
    columns = np.stack([t, 2e-3 * np.cos(80 * t) * np.exp(-t)])
    print(f"{'file':16}{'fricjax':>9}{'other':>9}{'ratio':>7}")

    def show(name: str, ours: Callable[[], Any], other: Callable[[], Any], repeats: int) -> None:
        first, second = shortest([ours, other], repeats)
        print(f"{name:16}{1e3 * first:9.2f}{1e3 * second:9.2f}{first / second:7.2f}", flush=True)

    with tempfile.TemporaryDirectory() as scratch:
        readers = write_texts(Path(scratch), columns)
        hdf5 = Path(scratch) / "run.h5"
        with h5py.File(hdf5, "w") as file:
            for title, values in zip(("t", "x"), columns, strict=True):
                file[title] = values
        for path, other in {**readers, hdf5: partial(with_h5py, hdf5)}.items():
            show(path.name, partial(fj.read, path), other, options.repeats)
        folder = Path(scratch) / "folder"
        folder.mkdir()
        paths = [folder / f"{i:04}.csv" for i in range(options.files)]
        text = (Path(scratch) / TEXTS[0][0]).read_text()
        for path in paths:
            path.write_text(text)
        show("folder", lambda: [fj.read(path) for path in paths], lambda: [pd.read_csv(path) for path in paths], 1)


if __name__ == "__main__":
    main()
