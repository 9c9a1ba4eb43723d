"""Timing in turns, and new processes for cold times and peak memory."""

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
# Shortest time of a turn [s].
TURN = 0.02
# No further calls after this total time of a method [s].
PATIENCE = 60.0


class Timed(NamedTuple):
    """Median time of one call [s] and result of the last call."""

    seconds: float
    result: Any


class Fresh(NamedTuple):
    """Measurements of a new process.

    Attributes:
        cold: time to the first result [s].
        warm: times of the later calls [s].
        peak: peak memory [MB].
    """

    cold: float
    warm: list[float]
    peak: float


def race(jobs: Mapping[str, Job], repeats: int) -> dict[str, Timed]:
    """Call jobs in turns and return their times and results.

    The order is A B A B ... All jobs thus see the same state of the machine. The first round only warms up. A turn of a
    short job has several calls, because its first call after another job finds the caches cold.
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
    """Return the last result and the time of each call [s]."""
    result, times = None, []
    while sum(times) < TURN:
        begin = time.perf_counter()
        result = job()
        times.append(time.perf_counter() - begin)
    return result, times


def fresh(workload: str, method: str, of: Path | str, calls: int = 1) -> Fresh:
    """Run one job in a new interpreter.

    `of` is a file of records or a number of displacements.

    Raises:
        RuntimeError: the job failed; the message contains its error output.
    """
    begin = time.monotonic()
    command = [sys.executable, str(WORKER), workload, method, str(of), str(calls)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{method} failed on {workload}: {done.stderr[-2000:]}")
    told = json.loads(done.stdout.splitlines()[-1])
    return Fresh(told["first"] - begin, told["warm"], told["peak"])
