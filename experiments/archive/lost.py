"""Kill drivers and workers at random, restart them, and compare the table.

    python experiments/archive/lost.py [--kills 20] [--runs 200] [--workers 2] [--seed 1]

Each round starts `fricjax batch --workers 2` on a new store. It kills the driver, a worker or both by SIGKILL between
the start of the first worker and the usual end. Then it restarts the driver until it ends. The table must equal that of
a batch without kills, row for row except for times, hosts and processes. No row may be in the parts twice.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd
import psutil

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.archive.make import make  # noqa: E402
from experiments.archive.run import table_of, words  # noqa: E402

# Columns that differ between repetitions.
PASSING = ["seconds_read", "seconds_fit", "finished_at", "host", "worker"]
VICTIMS = ("driver", "worker", "both")


def workers_of(process: subprocess.Popen) -> list[psutil.Process]:
    """List the worker processes of a driver: descendants that have loaded JAX."""
    try:
        descendants = psutil.Process(process.pid).children(recursive=True)
        return [each for each in descendants if each.memory_info().rss > 200e6]
    except psutil.Error:
        return []


def started(folder: Path, out: Path, workers: int) -> subprocess.Popen:
    command = [*words(folder, out, "--workers", str(workers)), "--quiet"]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen) -> None:
    """Wait until a process ends and check its exit code."""
    _, told = process.communicate(timeout=600)
    if process.returncode != 1:
        raise RuntimeError(f"ended with {process.returncode}: {told}")


def killed(folder: Path, out: Path, workers: int, victim: str, delay: float, chance: random.Random) -> str:
    """Kill a driver, a worker or both after the first worker appears.

    `delay` is the time from the first worker to the kill [s]. Returns the names of the killed processes.
    """
    process, names = started(folder, out, workers), []
    while process.poll() is None and not workers_of(process):
        time.sleep(0.02)
    time.sleep(delay)
    alive = workers_of(process)
    if victim in ("worker", "both") and alive:
        chance.choice(alive).kill()
        names.append("worker")
    if victim in ("driver", "both") and process.poll() is None:
        process.send_signal(signal.SIGKILL)
        names.append("driver")
    if "driver" in names:
        process.communicate()
        _, left = psutil.wait_procs(alive, timeout=30)
        if left:
            raise RuntimeError(f"{len(left)} workers outlive their driver by 30 s")
    else:
        ended(process)
    return " and ".join(names) or "nothing"


def rows_of(out: Path) -> pd.DataFrame:
    table = table_of(out).drop(columns=PASSING)
    return table.sort_values(["file", "run", "friction"]).reset_index(drop=True)


def twice(out: Path) -> int:
    """Count runs that are recorded more than once."""
    keys = pd.concat([pd.read_parquet(part, columns=["key", "run"]) for part in (out / "parts").glob("*.parquet")])
    return int(keys.duplicated().sum())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, wrong = random.Random(options.seed), 0
    with tempfile.TemporaryDirectory() as scratch:
        folder, whole = Path(scratch) / "archive", Path(scratch) / "whole"
        make(folder, options.runs)
        begin = time.perf_counter()
        ended(started(folder, whole, options.workers))
        usual, expected = time.perf_counter() - begin, rows_of(whole)
        load = os.getloadavg()[0]
        print(f"{len(expected)} rows in {usual:.1f} s without a kill; {os.cpu_count()} cores, load {load:.1f}")
        for number in range(options.kills):
            out, delay = Path(scratch) / f"out{number}", chance.uniform(0, 0.8 * usual)
            what = killed(folder, out, options.workers, VICTIMS[number % len(VICTIMS)], delay, chance)
            done = sum(len(pd.read_parquet(part, columns=["key"])) for part in (out / "parts").glob("*.parquet"))
            ended(started(folder, out, options.workers))
            same, doubled = rows_of(out).equals(expected), twice(out)
            wrong += not same or bool(doubled)
            print(
                f"{number + 1:3}: {what:18} killed after {delay:5.1f} s, {done:4} rows before the second start; table "
                f"{'the same' if same else 'DIFFERENT'}, {doubled} rows twice",
                flush=True,
            )
    print(f"{options.kills} kills, {wrong} with a different table or rows twice")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
