"""Damages sound files of every format a few thousand times over and counts how reading them ends.

Run `python experiments/files/fuzz.py --mutations 10000 [--only v5.mat] [--first 0]`. Every end but "read" and the
package's own two refusals is a fault, as are more than 5 s and 1 GB; the table names the mutations, and `--keep FOLDER`
writes them there. The files are read in a process of its own, which is started anew where one kills it.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.files.mutate import mutated  # noqa: E402
from experiments.files.outcome import SECONDS, attempt, limit_memory  # noqa: E402
from experiments.files.seeds import SEEDS, write_seeds  # noqa: E402

_GRACE = 3 * SECONDS


def work(folder: Path, name: str, first: int, last: int) -> None:
    """Reads the mutations of one seed and prints a line for each."""
    content = (folder / "seeds" / name).read_bytes()
    target = folder / f"case-{name}"
    limit_memory(4.0)
    for number in range(first, last):
        target.write_bytes(mutated(name, content, number))
        print(json.dumps([number, *attempt(target)]), flush=True)


def supervised(folder: Path, name: str, first: int, last: int) -> list[list]:
    """Outcomes of all mutations of one seed, whatever becomes of the process that reads them."""
    lines: list[list] = []
    while first < last:
        command = [sys.executable, __file__, "--worker", str(folder), name, str(first), str(last)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as worker:
            first, ended = _followed(worker, first, lines)
        if first < last and ended:
            lines.append([first, ended, "", 0.0, 0.0])
            first += 1
    return lines


def _followed(worker: subprocess.Popen, first: int, lines: list[list]) -> tuple[int, str]:
    """The number after the last mutation that was read, and how the process ended where it was killed."""
    import os
    import selectors

    assert worker.stdout is not None
    os.set_blocking(worker.stdout.fileno(), False)
    waiting, rest, patience = selectors.DefaultSelector(), "", 120.0
    waiting.register(worker.stdout, selectors.EVENT_READ)
    while True:
        if not waiting.select(patience):
            worker.kill()
            return first, "hangs"
        text = worker.stdout.read()
        if not text:
            code = worker.wait()
            return first, "" if code == 0 else f"killed ({code})"
        *whole, rest = (rest + text).split("\n")
        for line in whole:
            lines.append(json.loads(line))
            first, patience = lines[-1][0] + 1, _GRACE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutations", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=list(SEEDS))
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--worker", nargs=4)
    options = parser.parse_args()
    if options.worker:
        folder, name, first, last = options.worker
        return work(Path(folder), name, int(first), int(last))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        seeds = write_seeds(folder / "seeds")
        share = -(-options.mutations // len(options.only))
        begin, rows, faults = time.perf_counter(), {}, []
        for name in options.only:
            found = supervised(folder, name, options.first, options.first + share)
            rows[name] = found
            faults += [(name, *line) for line in found if line[1] not in ("read", "DataError", "UsageError")]
            _print_row(name, found)
        print(f"{sum(map(len, rows.values()))} files in {time.perf_counter() - begin:.0f} s, {len(faults)} faults")
        for name, number, end, words, seconds, gigabytes in faults:
            print(f"  {name} {number}: {end}, {seconds:.1f} s, {gigabytes:.2f} GB: {words[:160]!r}")
            if options.keep:
                options.keep.mkdir(parents=True, exist_ok=True)
                (options.keep / f"{number}-{name}").write_bytes(mutated(name, seeds[name], number))
    return None


def _print_row(name: str, found: list[list]) -> None:
    ends = Counter(line[1] for line in found)
    slowest, largest = max(line[3] for line in found), max(line[4] for line in found)
    told = ", ".join(f"{end} {count}" for end, count in sorted(ends.items()))
    print(f"{name:12} {len(found):6} files: {told}; slowest {slowest:.2f} s, largest {largest:.2f} GB", flush=True)


if __name__ == "__main__":
    main()
