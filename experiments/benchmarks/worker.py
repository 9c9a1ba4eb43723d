"""One job in a process of its own: prints when the first result was there, the times after it, and the peak memory.

python worker.py WORKLOAD METHOD FILE CALLS
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
    # Read before the pool closes: a process that has ended tells nothing.
    peak = sum(peak_memory(pid) for pid in ("self", *(str(child.pid) for child in active_children())))
    if isinstance(job, Pool):
        job.close()
    print(json.dumps({"first": first, "warm": warm, "peak": peak}))


def peak_memory(pid: str) -> float:
    """Largest resident memory of a process so far [MB]; getrusage would count that of its parent before it began."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1e3


if __name__ == "__main__":
    main(*sys.argv[1:])
