"""Make an archive of runs in mixed formats and its true values.

    python experiments/archive/make.py FOLDER [--runs 1000] [--seed 1]

One run in twenty is broken. FOLDER/runs holds the files by load and lubricant, FOLDER/rig.toml the machine, and
FOLDER/truth.csv one row for each file: coefficients, format and noise. The row of a broken file also gives its fault,
the required status, and the required reason as a regular expression.
"""

import argparse
import csv
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from experiments.archive.faults import FAULTS  # noqa: E402
from experiments.archive.formats import FORMATS, WORKBOOK  # noqa: E402
from experiments.archive.motion import DAMPING, LOADS, STIFFNESS, Truth, measured, rig_file  # noqa: E402

BROKEN_EVERY, WORKBOOK_EVERY, LONGEST_WORKBOOK = 20, 25, 3000
RATES, DURATIONS = (2e3, 5e3, 10e3), (0.6, 1.0, 2.0)
NOISES = ("white", "white", "white", "coloured", "quantised")
LUBRICANTS = ("dry", "oil", "grease")


def drawn(random: np.random.Generator) -> Truth:
    """Draw a random run."""
    rate = float(random.choice(RATES))
    return Truth(
        load=float(random.choice(LOADS)),
        mu=float(random.uniform(0.005, 0.02)),
        x0=float(random.choice([-1, 1]) * random.uniform(0.5e-3, 3e-3)),
        hold=float(random.uniform(0.01, 0.1)),
        rate=rate,
        samples=round(rate * float(random.choice(DURATIONS))),
        noise=str(random.choice(NOISES)),
    )


def add_run(folder: Path, number: int, random: np.random.Generator) -> dict[str, Any]:
    """Write one run and return its row of true values."""
    truth, lubricant, fault = drawn(random), str(random.choice(LUBRICANTS)), ""
    status, reason = "ok", ""
    if number % BROKEN_EVERY == 0:
        fault = list(FAULTS)[number // BROKEN_EVERY % len(FAULTS)]
        ending, write, status, reason = FAULTS[fault]
        kind = fault
    elif number % WORKBOOK_EVERY == 1:
        kind, (ending, write) = "workbook", WORKBOOK
        truth = truth._replace(samples=min(truth.samples, LONGEST_WORKBOOK))
    else:
        kind = list(FORMATS)[number % len(FORMATS)]
        ending, write = FORMATS[kind]
    place = folder / "runs" / f"load_{truth.load}N" / lubricant / f"{number:04}.{ending}"
    place.parent.mkdir(parents=True, exist_ok=True)
    write(place, truth.t, measured(truth, random))
    expected = {"format": kind, "fault": fault, "status": status, "reason": reason}
    machine = {"damping": DAMPING, "stiffness": STIFFNESS, "lubricant": lubricant}
    return {"file": place.relative_to(folder / "runs").as_posix(), **truth._asdict(), **machine, **expected}


def make(folder: Path, runs: int = 1000, seed: int = 1) -> None:
    """Make the whole archive in a folder that is empty or missing."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(rig_file())
    random = np.random.default_rng(seed)
    truths = [add_run(folder, number, random) for number in range(runs)]
    with (folder / "truth.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(truths[0]))
        table.writeheader()
        table.writerows(truths)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    begin = time.perf_counter()
    make(options.folder, options.runs, options.seed)
    size = sum(path.stat().st_size for path in options.folder.rglob("*") if path.is_file())
    print(f"{options.runs} runs, {size / 1e6:.0f} MB in {options.folder}, {time.perf_counter() - begin:.1f} s")


if __name__ == "__main__":
    main()
