"""Make an archive, process it by `fricjax batch`, and check the table.

    python experiments/archive/run.py [FOLDER] [--runs 1000] [--workers N]

Prints the number of fitted good runs and their errors in standard errors, the number of broken runs with the correct
status and reason, the exit code, the elapsed time, the CPU time of all processes, and the largest memory of a process.
The exit code is 1 if a check fails.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.archive.make import make  # noqa: E402

FRICJAX = [sys.executable, "-c", "from fricjax.cli.main import main; main()"]
FACTS = "load_{load}N/{lubricant}/{number}.*"
FREE = ("mu", "damping", "stiffness")
ERRORS, SHARE, GIGABYTES = 5.0, 0.999, 1.5
"""A share `SHARE` of the good runs must lie within `ERRORS` standard errors; memory limit of one process [GB]."""


def words(folder: Path, out: Path, *further: str) -> list[str]:
    """Return the command as a list of words."""
    return [*FRICJAX, "batch", str(folder / "runs"), "--rig", str(folder / "rig.toml"), "--facts", FACTS,
            "--out", str(out), *further]  # fmt: skip


def table_of(out: Path) -> pd.DataFrame:
    import fricjax as fj

    return fj.open_archive(out).to_dataframe()


def judged(truth: pd.DataFrame, table: pd.DataFrame) -> dict[str, Any]:
    """Compare the table with the true values."""
    both = truth.merge(table, on="file", how="left", suffixes=("_true", ""))
    good, broken = both[both["fault"] == ""], both[both["fault"] != ""]
    off = np.abs([(good[name] - good[f"{name}_true"]) / good[f"{name}_std"] for name in FREE])
    fitted = (good["status"] == "ok").to_numpy()
    near = fitted & (off < ERRORS).all(axis=0)
    right = [
        row.status == row.status_true and pd.Series([str(row.outcome)]).str.contains(row.reason)[0]
        for row in broken.itertuples()
    ]
    for row in [*good[~near].itertuples(), *broken[~np.array(right, bool)].itertuples()]:
        print(f"  {row.file}: {row.fault or row.format}: {row.status}: {str(row.outcome)[:200]}")
    return {
        "rows": len(table),
        "good": len(good),
        "fitted": int(fitted.sum()),
        "near": int(near.sum()),
        "worst": float(np.nanmax(off)),
        "broken": len(broken),
        "right": sum(right),
        "loads": bool(np.allclose(both["load"][both["status"] == "ok"], both["load_true"][both["status"] == "ok"])),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--workers", type=int, help="number of worker processes; default: all work in the driver")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch)
        if not (folder / "truth.csv").is_file():
            make(folder, options.runs)
        out = Path(scratch) / "out"
        begin, load = time.perf_counter(), os.getloadavg()[0]
        workers = ["--workers", str(options.workers)] if options.workers else []
        code = subprocess.run([*words(folder, out, *workers), "--quiet"], stdout=subprocess.DEVNULL).returncode
        seconds = time.perf_counter() - begin
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        figures = judged(pd.read_csv(folder / "truth.csv", keep_default_na=False), table_of(out))
    gigabytes = used.ru_maxrss / 1e6
    print("{good} good runs: {fitted} fitted, {near} within 5 standard errors (worst {worst:.2f})".format(**figures))
    print("{broken} broken runs: {right} with the right status and reason; loads right: {loads}".format(**figures))
    print(
        f"exit code {code}; {seconds:.1f} s, {used.ru_utime + used.ru_stime:.1f} s of computing, largest process "
        f"{gigabytes:.2f} GB; {os.cpu_count()} cores, load before {load:.1f}, after {os.getloadavg()[0]:.1f}"
    )
    held = figures["near"] >= SHARE * figures["good"] and figures["right"] == figures["broken"] and figures["loads"]
    return int(not (held and code == 1 and gigabytes <= GIGABYTES))


if __name__ == "__main__":
    sys.exit(main())
