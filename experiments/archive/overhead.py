"""Measure the overhead of Dask without fits.

    python experiments/archive/overhead.py [--runs 6400] [--workers 1]

The work of each chunk only returns one row of the usual size for each run. The script prints elapsed and CPU time of
the driver per run, from the first returned chunk to the last. For comparison, a fit takes some ten milliseconds.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
os.environ["PYTHONPATH"] = str(ROOT)

import fricjax as fj  # noqa: E402
from fricjax.archive import Law, Study, workers  # noqa: E402
from fricjax.archive.plan import Chunk, Job, Signature  # noqa: E402
from fricjax.archive.work import Done, Work  # noqa: E402

CHUNK, POINTS = 32, 256


class Idle(Work):
    """Return rows with plots as of a fit, without fitting."""

    def __call__(self, chunk: Chunk) -> Done:
        picture = {name: np.zeros(POINTS) for name in ("sketch_t", "sketch_x", "sketch_residual")}
        numbers = {f"number_{i}": 0.1 * i for i in range(50)}
        return Done([{"file": job.file, "status": "ok", **picture, **numbers} for job in chunk], {})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=6400)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    study = Study(Path.cwd(), (Law("coulomb", machine, ("mu", "damping", "stiffness")),))
    jobs = [Job(f"run_{i}.npz", Signature(0, "", 0), (0,)) for i in range(options.runs)]
    chunks = [tuple(jobs[i : i + CHUNK]) for i in range(0, options.runs, CHUNK)]
    results = workers(options.workers)(chunks, Idle(study))
    done = len(next(results)[0])
    begin, computing = time.perf_counter(), time.process_time()
    rest = sum(len(chunk) for chunk, _ in results)
    wall, used = time.perf_counter() - begin, time.process_time() - computing
    print(
        f"{done + rest} runs by {options.workers} workers: {1e3 * wall / rest:.3f} ms and {1e3 * used / rest:.3f} ms "
        f"of computing of the driver per run (with the end of the workers); {os.cpu_count()} cores, "
        f"load {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main()
