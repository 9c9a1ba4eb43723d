"""Run one job in a new process.

    python worker.py WORKLOAD METHOD FILE CALLS

Prints the time of the first result, the times of the later calls, and the peak memory.
"""

import json
import sys
import time
from multiprocessing import active_children
from pathlib import Path

from jobs import displacements, fits
from peers.pool import Pool


def main(workload: str, method: str, path: str, calls: str) -> None:
    forward = workload in ("map", "sliding")
    job = displacements(workload, method, int(path)) if forward else fits(method, Path(path))
    job()
    first, warm = time.monotonic(), []
    for _ in range(int(calls) - 1):
        begin = time.perf_counter()
        job()
        warm.append(time.perf_counter() - begin)
    # Read this before the pool closes: an ended process has no status.
    peak = sum(peak_memory(pid) for pid in ("self", *(str(child.pid) for child in active_children())))
    if isinstance(job, Pool):
        job.close()
    print(json.dumps({"first": first, "warm": warm, "peak": peak}))


def peak_memory(pid: str) -> float:
    """Read the largest resident memory of a process so far [MB].

    getrusage would include the memory of the parent process before the fork.
    """
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1e3


if __name__ == "__main__":
    main(*sys.argv[1:])
