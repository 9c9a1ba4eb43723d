"""Measure the speed of archives.

Usage: `python experiments/archive/throughput.py [--runs 256] [--many 20000] [--for-workers 0]`.

The script fits HDF5 files of 10,000 samples under Coulomb's law, from files to the table. In turn it calls `fit_batch`
on the same displacements as an array. Programs are compiled beforehand. The best time of each counts, because other
load on the machine only slows both down. With `--for-workers N`, one and two worker processes also fit N files in turn;
these times include start and end of the workers. Then the script plans a folder of many small files and restarts a
finished store. There a copy of one row replaces each fit, so that only the overhead is measured.
"""

import argparse
import dataclasses
import os
import resource
import shutil
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

import fricjax as fj
from fricjax.archive import Law, Study
from fricjax.archive.driver import plan_of
from fricjax.archive.work import Done

jax.config.update("jax_enable_x64", True)

MACHINE = fj.Oscillator(0.41, 2574.0, 0.17, 9.66, fj.friction.Coulomb(0.02))
FREE = ("mu", "damping", "stiffness")
RATE, DURATION = 1e4, 1.0
ROUNDS = 4


def made(folder: Path, runs: int) -> np.ndarray:
    """Write files of runs and return their displacements."""
    folder.mkdir()
    x = []
    for seed in range(runs):
        start = 2e-3 * (1 + 0.2 * seed / runs)
        run = fj.synthetic_run(MACHINE, start, rate=RATE, duration=DURATION, noise=2e-9, seed=seed)
        fj.write(run, folder / f"run_{seed:05d}.h5")
        x.append(run.x)
    return np.array(x)


def timed(work) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def throughput(place: Path, runs: int) -> None:
    x = made(place / "runs", runs)
    stores = iter(range(100))
    by_files = lambda: fj.batch(place / "runs", place / f"store_{next(stores)}", MACHINE, FREE)
    by_array = lambda: fj.fit_batch(x, MACHINE, FREE, rate=RATE)
    by_files(), by_array()
    files, arrays = zip(*((timed(by_files), timed(by_array)) for _ in range(ROUNDS)), strict=True)
    print(f"{runs} runs of {x.shape[1]} samples, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for name, seconds in (("fit_batch on an array", arrays), ("files to table", files)):
        print(f"{name:<22} {1e3 * min(seconds) / runs:7.2f} ms/run  {runs / min(seconds):7.1f} runs/s")
    pairs = ", ".join(f"{array / file:.2f}" for file, array in zip(files, arrays, strict=True))
    print(f"share of fit_batch     {min(arrays) / min(files):7.2f}  (in turn: {pairs}; target: 0.60)")
    print(f"memory at most         {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:7.2f} GB (target: 1.5)")


def by_workers(place: Path, runs: int) -> None:
    made(place / "for_workers", runs)
    stores = iter(range(100))
    by = lambda number: fj.batch(
        place / "for_workers", place / f"by_workers_{next(stores)}", MACHINE, FREE, execute=fj.archive.workers(number)
    )
    by(1)
    one, two = zip(*((timed(lambda: by(1)), timed(lambda: by(2))) for _ in range(2)), strict=True)
    print(f"\n{runs} runs, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"one worker             {min(one):7.2f} s")
    print(f"two workers            {min(two):7.2f} s, {min(one) / min(two):.2f} times as fast  (target: 1.7)")


class Copies:
    """Executor that fits one file and copies its row for the others."""

    def __init__(self) -> None:
        self.row = None

    def __call__(self, chunks, work):
        for chunk in chunks:
            if self.row is None:
                (self.row,) = work(chunk[:1]).rows
            rows = [{**self.row, "file": job.file, "key": job.file, **job.signature._asdict()} for job in chunk]
            yield chunk, Done(rows, {})


def many(place: Path, files: int) -> None:
    folder = place / "many"
    run = fj.synthetic_run(MACHINE, 2e-3, rate=1e3, duration=0.5, noise=2e-9, seed=0)
    (folder / "day_00").mkdir(parents=True)
    content = fj.write(run, folder / "day_00" / "run_00000.csv").read_bytes()
    for number in range(1, files):
        file = folder / f"day_{number % 50:02d}" / f"run_{number:05d}.csv"
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(content)
    study = Study(folder, (Law("coulomb", MACHINE, FREE),), facts=("day_{day}/run_{number}.csv",))
    print(f"\n{files} files")
    print(f"plan                   {timed(lambda: plan_of(study, place / 'all')):7.2f} s  (target: 5)")
    print(f"records and table      {timed(lambda: fj.batch(study, place / 'all', execute=Copies())):7.2f} s")
    resume = timed(lambda: fj.batch(study, place / "all", execute=Copies()))
    print(f"resume, nothing to do  {resume:7.2f} s  (target: 3)")
    print(f"table as a data frame  {timed(lambda: fj.archive.results(place / 'all')):7.2f} s")
    size = sum(file.stat().st_size for file in (place / "all").rglob("*.parquet"))
    print(f"store                  {size / 1e6:7.1f} MB")
    for file in sorted(folder.rglob("*.csv")):
        os.utime(file)
    print(f"all files touched      {timed(lambda: fj.batch(study, place / 'all', execute=Copies())):7.2f} s")
    assert len(fj.archive.results(place / "all")) == files, dataclasses.asdict(study)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=256)
    parser.add_argument("--many", type=int, default=20_000)
    parser.add_argument("--for-workers", type=int, default=0)
    asked = parser.parse_args()
    place = Path(tempfile.mkdtemp(prefix="fricjax-throughput-"))
    try:
        throughput(place, asked.runs)
        if asked.for_workers:
            by_workers(place, asked.for_workers)
        many(place, asked.many)
    finally:
        shutil.rmtree(place)


if __name__ == "__main__":
    main()
