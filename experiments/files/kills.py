"""Kill commands while they write, and check their files.

Usage: `python experiments/files/kills.py [--kills 20]`.

Each command runs in a folder that already has its output files. It gets SIGKILL at a random change of the folder: the
first, the second, and so on. Each file must then equal the old or the new one to the last byte. The table counts kills
after which all files were old, all were new, some were old and some new, or one was neither. It also counts kills that
left a temporary file. The next run must remove such files.
"""

import argparse
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

import fricjax as fj
from fricjax.data.read import example_paths

jax.config.update("jax_enable_x64", True)

RUN, RIG = map(str, example_paths())
LAUNCH = [sys.executable, "-c", "from fricjax.cli.main import main; main()"]
# Arguments of each command, and names of its output files.
COMMANDS = {
    "demo": (["demo", "--out", "."], ["run.csv", "rig.toml", "fit.json", "fit.png"]),
    "fit": (
        ["fit", RUN, "--rig", RIG, "--plot", "fit.png", "--out", "fit.json", "--save", "record.h5"],
        ["fit.png", "fit.json", "record.h5"],
    ),
    "calibrate": (
        ["calibrate", "ringdown", "{free}", "--mass", "0.41", "--normal-force", "1.89", "--out", "rig.toml"],
        ["rig.toml"],
    ),
    "simulate": (
        ["simulate", "--rig", RIG, "--fix", "mu=0.02", "--x0", "2 mm", "--out", "run.npz", "--plot", "run.png"],
        ["run.npz", "run.png"],
    ),
    "inspect": (["inspect", RUN, "--plot", "run.pdf"], ["run.pdf"]),
    "energy": (
        ["energy", RUN, "--rig", RIG, "--plot", "force.png", "--out", "force.json"],
        ["force.png", "force.json"],
    ),
    "check": (
        ["check", "--rig", RIG, "--friction", "coulomb", "--fix", "mu=0.02", "--x0", "2 mm", "--plot", "check.png"],
        ["check.png"],
    ),
    "map": (["map", "{pairs}", "--rig", RIG, "--plot", "map.png"], ["map.png"]),
    "compare": (
        ["compare", RUN, "--rig", RIG, "--friction", "coulomb", "--no-held-out", "--plot", "laws.png"],
        ["laws.png"],
    ),
}
# Without a fixed date each PDF contains its time of creation.
SAME_DATE = {**os.environ, "SOURCE_DATE_EPOCH": "0"}
OLD = b"the old file\n" * 1000


def free_decay(folder: Path) -> Path:
    """Write the record for `calibrate`."""
    machine = fj.Oscillator(0.41, 2574.0, 0.175, 1.0, fj.friction.Coulomb(0.0))
    return fj.write(fj.synthetic_run(machine, 2e-3, rate=2e3, duration=5.0, noise=5e-9, seed=2), folder / "free.npz")


def pairs_of_displacements(folder: Path) -> Path:
    """Write the table for `map`."""
    band = 0.02 * 9.66 / 2574.0
    x0 = np.linspace(1.1e-3, 2e-3, 12)
    table = folder / "pairs.csv"
    # Each half-cycle reduces the amplitude by two dead bands, until the mass stays.
    xf = [float((-1) ** round(n) * (x - 2 * n * band)) for x in x0 for n in [np.ceil((x / band - 1) / 2)]]
    table.write_text("x0 [m],xf [m]\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(x0.tolist(), xf, strict=True)))
    return table


def state(folder: Path) -> frozenset:
    """Return names, files, sizes and times of the entries of a folder."""
    found = set()
    with os.scandir(folder) as entries:
        for entry in entries:
            try:
                about = entry.stat()
            except FileNotFoundError:
                continue
            found.add((entry.name, about.st_ino, about.st_size, about.st_mtime_ns))
    return frozenset(found)


def run(words: list[str], folder: Path, most: float = math.inf) -> int:
    """Run a command, or kill it after `most` changes of the folder.

    Returns the number of changes.
    """
    process = subprocess.Popen(
        [*LAUNCH, *words, "--force", "--quiet"],
        cwd=folder,
        env=SAME_DATE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    seen, changes = state(folder), 0
    while process.poll() is None and changes < most:
        found = state(folder)
        changes += found != seen
        seen = found
        # Polling without pause would slow down the command while it computes.
        time.sleep(0.0 if changes else 2e-3)
    if changes >= most:
        process.send_signal(signal.SIGKILL)
    _, told = process.communicate()
    if process.returncode > 0:
        raise RuntimeError(f"fricjax {' '.join(words)} ended with {process.returncode}: {told.decode()}")
    return changes


def killed(words: list[str], names: list[str], kills: int, seed: int, scratch: Path) -> dict[str, int]:
    """Count outcomes over all kills of a command."""
    folder = Path(tempfile.mkdtemp(dir=scratch))
    run(words, folder)
    changes = run(words, folder)
    new = {name: (folder / name).read_bytes() for name in names}
    rng = random.Random(seed)
    counts = dict.fromkeys(("old", "new", "mixed", "damaged", "temporary"), 0)
    for _ in range(kills):
        shutil.rmtree(folder)
        folder.mkdir()
        for name in names:
            (folder / name).write_bytes(OLD)
        run(words, folder, rng.randint(1, changes))
        found = {name: (folder / name).read_bytes() for name in names}
        kinds = {"old" if found[name] == OLD else "new" if found[name] == new[name] else "damaged" for name in names}
        counts["damaged" if "damaged" in kinds else "mixed" if len(kinds) > 1 else kinds.pop()] += 1
        counts["temporary"] += sorted(os.listdir(folder)) != sorted(names)
    run(words, folder)
    if sorted(os.listdir(folder)) != sorted(names):
        raise RuntimeError(f"{words[0]} has left {sorted(os.listdir(folder))}.")
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--commands", nargs="*", default=list(COMMANDS), choices=list(COMMANDS))
    options = parser.parse_args()
    print(f"{'command':12}{'kills':>6}{'old':>6}{'new':>6}{'mixed':>7}{'damaged':>9}{'temporary':>11}")
    with tempfile.TemporaryDirectory() as scratch:
        made = {"free": free_decay(Path(scratch)), "pairs": pairs_of_displacements(Path(scratch))}
        for seed, name in enumerate(options.commands):
            words, names = COMMANDS[name]
            told = killed([word.format(**made) for word in words], names, options.kills, seed, Path(scratch))
            numbers = "".join(f"{told[kind]:>{width}}" for kind, width in zip(told, (6, 6, 7, 9, 11), strict=True))
            print(f"{name:12}{options.kills:>6}{numbers}", flush=True)


if __name__ == "__main__":
    main()
