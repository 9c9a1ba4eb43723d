"""Measure the time of reading: `python experiments/files/times.py`.

Prints the time of fricjax and of pandas for a table of a million rows, read in turn. Prints also the memory for ten
million rows, and the time in which a command refuses a missing file and a misspelt law.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import fricjax as fj
from fricjax.data.read import example_paths

ROWS, LONG, ROUNDS = 10**6, 10**7, 9
PEAK = """import sys, resource, fricjax
fricjax.read(sys.argv[1])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"""
LAUNCH = [sys.executable, "-c", "from fricjax.cli.main import main; main()"]
REFUSALS = {
    "a missing file": ["fit", "missing.csv"],
    "a misspelt law": ["fit", str(example_paths().run), "--friction", "stribek"],
}


def write(path: Path, rows: int) -> None:
    """Write a table of times and displacements."""
    with path.open("w") as file:
        file.write("Time [s],Displacement [m]\n")
        for start in range(0, rows, ROWS):
            t = np.arange(start, min(rows, start + ROWS)) * 1e-4
            x = 2e-3 * np.cos(t) + 5e-9 * np.random.default_rng(start).standard_normal(t.size)
            file.writelines(f"{a:.4f},{b!r}\n" for a, b in zip(t.tolist(), x.tolist(), strict=True))


def seconds(call: Callable[[], object]) -> float:
    """Measure the time of one call [s]."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def main() -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "million.csv"
        write(path, ROWS)
        pairs = [(seconds(lambda: fj.read(path)), seconds(lambda: pd.read_csv(path))) for _ in range(ROUNDS + 1)][1:]
        ours, theirs = (min(column) for column in zip(*pairs, strict=True))
        print(f"{ROWS:.0e} rows: {1e3 * ours:.0f} ms, pandas {1e3 * theirs:.0f} ms, ratio {ours / theirs:.2f}")
        path = Path(folder) / "ten.csv"
        write(path, LONG)
        peak = int(
            subprocess.run([sys.executable, "-c", PEAK, path], capture_output=True, text=True, check=True).stdout
        )
        print(f"{LONG:.0e} rows: {peak / 2**20:.2f} GB at most")
        for what, words in REFUSALS.items():
            ask = lambda words=words: subprocess.run([*LAUNCH, *words], cwd=folder, capture_output=True)
            spans = [seconds(ask) for _ in range(ROUNDS)]
            print(f"{what}: refused within {min(spans):.2f} to {max(spans):.2f} s")


if __name__ == "__main__":
    main()
