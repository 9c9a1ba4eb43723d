"""Times in turns, and fresh processes for cold times and peak memory."""

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from jobs import Job

WORKER = Path(__file__).with_name("worker.py")
# Least time of a turn [s].
TURN = 0.02
# A method that has taken this long [s] is not asked again.
PATIENCE = 60.0


class Timed(NamedTuple):
    """Median time of one call [s] and what the last one returned."""

    seconds: float
    result: Any


class Fresh(NamedTuple):
    """A process of its own: time to the first result [s], times of the calls after it [s], peak memory [MB]."""

    cold: float
    warm: list[float]
    peak: float


def race(jobs: Mapping[str, Job], repeats: int) -> dict[str, Timed]:
    """Call the jobs in turns, A B A B ..., so that all see the same machine; the first round only warms them.

    Of a short job a turn is several calls: the first one behind another job finds its code and data no longer at hand,
    and would be all that is timed.
    """
    times: dict[str, list[float]] = {name: [] for name in jobs}
    results = {name: job() for name, job in jobs.items()}
    for _ in range(repeats):
        for name, job in jobs.items():
            if sum(times[name]) < PATIENCE:
                results[name], turn = _turn(job)
                times[name] += turn
    return {name: Timed(statistics.median(times[name]), results[name]) for name in jobs}


def _turn(job: Job) -> tuple[Any, list[float]]:
    """What the last call returned, and the time of each call [s]."""
    result, times = None, []
    while sum(times) < TURN:
        begin = time.perf_counter()
        result = job()
        times.append(time.perf_counter() - begin)
    return result, times


def fresh(workload: str, method: str, of: Path | str, calls: int = 1) -> Fresh:
    """One job in a new interpreter, on the records of a file or for a number of displacements.

    Raises:
        RuntimeError: it failed; the message is what it said.
    """
    begin = time.monotonic()
    command = [sys.executable, str(WORKER), workload, method, str(of), str(calls)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{method} failed on {workload}: {done.stderr[-2000:]}")
    told = json.loads(done.stdout.splitlines()[-1])
    return Fresh(told["first"] - begin, told["warm"], told["peak"])
