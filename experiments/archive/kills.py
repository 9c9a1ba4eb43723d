"""Kill `fricjax batch` at random moments and check its table.

Usage: `python experiments/archive/kills.py [--kills 20] [--runs 192]`.

The driver gets SIGKILL in the first 100 ms of its store, directly after a new part, and at random moments, until the
given number of kills has hit a working driver. Then it runs to its end. Its table must equal that of an uninterrupted
driver, row for row except for timings, and no run may have two records. Afterwards a driver writes to a disk that is
too small for all rows and continues when there is room.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import jax
import pyarrow.parquet

import fricjax as fj
from fricjax.archive.store import Store

jax.config.update("jax_enable_x64", True)

LAUNCH = [sys.executable, "-c", "from fricjax.cli.main import main; main()"]
MACHINE = fj.Oscillator(0.41, 2574.0, 0.17, 9.66, fj.friction.Coulomb(0.02))
OF_THE_MOMENT = ["seconds_read", "seconds_fit", "finished_at", "worker"]
LONGEST = 300.0


def made(folder: Path, runs: int) -> Path:
    (folder / "runs").mkdir()
    for seed in range(runs):
        run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.8, noise=2e-9, seed=seed)
        fj.write(run, folder / "runs" / f"run_{seed:04d}.npz")
    (folder / "runs" / "broken.csv").write_text("a,b\n1,x\n")
    rig = fj.Rig(mass=0.41, stiffness=2574.0, normal_force=9.66)
    rig.to_toml(folder / "rig.toml")
    return folder


def started(folder: Path, out: Path) -> subprocess.Popen:
    words = ["batch", str(folder / "runs"), "--rig", str(folder / "rig.toml"), "--out", str(out)]
    return subprocess.Popen([*LAUNCH, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def parts(out: Path) -> list[Path]:
    return sorted((out / "parts").glob("*.parquet")) if out.is_dir() else []


def rows(out: Path) -> list[dict]:
    table = fj.open_archive(out).to_dataframe().drop(columns=OF_THE_MOMENT)
    return table.astype(str).to_dict("records")


def twice(out: Path) -> int:
    """Count surplus records of runs."""
    keys = [key for part in parts(out) for key in pyarrow.parquet.read_table(part, columns=["key"])["key"].to_pylist()]
    return len(keys) - len(set(keys))


def killed(folder: Path, out: Path, kills: int) -> list[tuple[str, int]]:
    """Kill drivers; return the moment and the parts at each kill."""
    seen, begun = [], time.perf_counter()
    while len(seen) < kills and time.perf_counter() - begun < LONGEST + 10 * kills:
        moment = random.choice(("birth", "part", "any"))
        if moment == "birth":
            # The first 100 ms of a store.
            shutil.rmtree(out, ignore_errors=True)
        driver, before = started(folder, out), len(parts(out))
        if moment == "birth":
            while driver.poll() is None and not out.exists():
                time.sleep(0.0005)
            time.sleep(random.uniform(0.0, 0.1))
        elif moment == "part":
            # Directly after a new part in the store.
            while driver.poll() is None and len(parts(out)) == before:
                time.sleep(0.002)
            time.sleep(random.expovariate(20.0))
        else:
            time.sleep(random.uniform(0.5, 6.0))
        if driver.poll() is None:
            driver.send_signal(signal.SIGKILL)
            driver.communicate()
            seen.append((moment, len(parts(out))))
            # The store must be usable at once.
            with Store(out).locked():
                pass
        else:
            # The driver has ended. The next one starts from an empty store.
            assert driver.returncode == 1, driver.communicate()[1]
            shutil.rmtree(out)
    return seen


def full(folder: Path, out: Path, expected: list[dict]) -> str:
    """Fill a small disk with a store, then complete it elsewhere."""
    place = folder / "small"
    place.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(place)], capture_output=True)
    if done.returncode:
        return "full disk: not tried, because a tmpfs cannot be mounted here"
    try:
        driver = started(folder, place / "out")
        told = driver.communicate()[1].strip().splitlines()
        written = len(parts(place / "out"))
        shutil.copytree(place / "out", out)
    finally:
        subprocess.run(["umount", str(place)], check=True)
    after = started(folder, out)
    after.communicate()
    same = rows(out) == expected and twice(out) == 0
    return f"full disk: exit {driver.returncode} after {written} parts, then the same rows: {same}\n  {told[-1]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--runs", type=int, default=192)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    random.seed(asked.seed)
    folder = made(Path(tempfile.mkdtemp(prefix="fricjax-kills-")), asked.runs)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        whole = started(folder, folder / "whole")
        whole.communicate()
        expected = rows(folder / "whole")
        seen = killed(folder, folder / "out", asked.kills)
        left = sorted(path.name for path in (folder / "out").rglob(".fricjax-*.tmp"))
        last = started(folder, folder / "out")
        last.communicate()
        counts = Counter(moment for moment, _ in seen)
        number = sorted(number for _, number in seen)
        print(f"{len(seen)} kills: {dict(counts)}, after {number} parts; temporary files left by them: {len(left)}")
        same = rows(folder / "out") == expected
        print(f"exit {last.returncode}, {len(expected)} rows, the same as uninterrupted: {same}")
        print(f"runs with two records: {twice(folder / 'out')}")
        print(full(folder, folder / "grown", expected))
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
