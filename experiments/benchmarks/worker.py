"""One job in a process of its own: prints when the first result was there, the times after it, and the peak memory.

python worker.py WORKLOAD METHOD FILE CALLS
"""

import json
import resource
import sys
import time
from pathlib import Path

from jobs import displacements, fits
from peers.pool import CORES, Pool


def main(workload: str, method: str, path: str, calls: str) -> None:
    forward = workload in ("map", "sliding")
    job = displacements(workload, method, int(path)) if forward else fits(method, Path(path))
    job()
    first, warm = time.monotonic(), []
    for _ in range(int(calls) - 1):
        begin = time.perf_counter()
        job()
        warm.append(time.perf_counter() - begin)
    if isinstance(job, Pool):
        job.close()
    # Linux tells it in kB; for children only that of the largest.
    own, child = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(json.dumps({"first": first, "warm": warm, "peak": (own + CORES * child) / 1e3}))


if __name__ == "__main__":
    main(*sys.argv[1:])
