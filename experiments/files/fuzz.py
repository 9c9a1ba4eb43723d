"""Damage intact files of every format at random and read them.

Usage: `python experiments/files/fuzz.py --mutations 10000 [--only v5.mat] [--first 0]`.

Each file must be read or refused by one of the two error classes of fricjax. Every other outcome is a fault, and so are
more than 5 s and 1 GB. The table lists the faulty mutations, and `--keep FOLDER` writes them there. A separate process
reads the files. If a file kills it, a new process continues with the next file.
"""

import argparse
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.files.mutate import mutated  # noqa: E402
from experiments.files.outcome import Outcome, attempt, limit_memory  # noqa: E402
from experiments.files.seeds import SEEDS, write_seeds  # noqa: E402

_PATIENCE = 60.0  # seconds without output of the reading process
type Line = list[Any]
"""Number of the file, outcome, message, seconds and gigabytes."""


def jobs(names: list[str], mutations: int, first: int) -> list[tuple[str, int]]:
    """List seed file and number of each mutation."""
    share = -(-mutations // len(names))
    return [(name, number) for name in names for number in range(first, first + share)]


def work(folder: Path, files: list[tuple[str, int]], start: int) -> None:
    """Read the files from index `start` and print one line each."""
    seeds = {name: (folder / "seeds" / name).read_bytes() for name in {name for name, _ in files}}
    for name in seeds:
        attempt(folder / "seeds" / name)
    limit_memory(4.0)
    for place in range(start, len(files)):
        name, number = files[place]
        target = folder / f"case-{name}"
        target.write_bytes(mutated(name, seeds[name], number))
        print(json.dumps([place, *attempt(target)]), flush=True)


def supervised(folder: Path, count: int, arguments: list[str]) -> list[Line]:
    """Collect the outcomes of all files, also after crashes of the reader."""
    lines: list[Line] = []
    while len(lines) < count:
        command = [sys.executable, __file__, *arguments, "--worker", str(folder), str(len(lines))]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as worker:
            ended = _followed(worker, lines)
        if len(lines) < count:
            lines.append([len(lines), ended, "", 0.0, 0.0])
    return lines


def _followed(worker: subprocess.Popen, lines: list[Line]) -> str:
    """Append output lines of a worker process until it ends.

    The worker is killed if it prints nothing for `_PATIENCE` seconds.

    Returns how the process ended.
    """
    assert worker.stdout is not None
    waiting, rest = selectors.DefaultSelector(), b""
    waiting.register(worker.stdout, selectors.EVENT_READ)
    while waiting.select(_PATIENCE):
        text = os.read(worker.stdout.fileno(), 1 << 16)
        if not text:
            return f"killed ({worker.wait()})"
        *whole, rest = (rest + text).split(b"\n")
        lines += map(json.loads, whole)
    worker.kill()
    return "hangs"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutations", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=list(SEEDS))
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    files = jobs(options.only, options.mutations, options.first)
    if options.worker:
        work(Path(options.worker[0]), files, int(options.worker[1]))
        return 0
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        seeds = write_seeds(Path(scratch) / "seeds")
        lines = supervised(Path(scratch), len(files), sys.argv[1:])
    faults = [line for line in lines if not Outcome(*line[1:]).sound]
    for name in options.only:
        _print_row(name, [line for line in lines if files[line[0]][0] == name])
    print(f"{len(files)} files in {time.perf_counter() - begin:.0f} s, {len(faults)} faults")
    for place, end, words, seconds, gigabytes in faults:
        name, number = files[place]
        print(f"  {name} {number}: {end}, {seconds:.1f} s, {gigabytes:.2f} GB: {words[:160]!r}")
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
            (options.keep / f"{number}-{name}").write_bytes(mutated(name, seeds[name], number))
    return bool(faults)


def _print_row(name: str, found: list[Line]) -> None:
    ends = Counter(line[1] for line in found)
    slowest, largest = max(line[3] for line in found), max(line[4] for line in found)
    told = ", ".join(f"{end} {count}" for end, count in sorted(ends.items()))
    print(f"{name:12} {len(found):6} files: {told}; slowest {slowest:.2f} s, largest {largest:.2f} GB more", flush=True)


if __name__ == "__main__":
    sys.exit(main())
