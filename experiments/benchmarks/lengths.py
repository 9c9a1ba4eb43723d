"""Memory and compiled programs of a process that fits many lengths.

Records of 500 to 20,000 samples with 4 to 120 half-cycles are cut from Coulomb decays and fitted one after the other.
After every tenth of the fits the script prints the number of compiled programs, the memory and its mappings. A plot
shows all three over the fits. A kernel allows a process some 65,530 mappings, and each program takes a few.

    python experiments/benchmarks/lengths.py [--fits 2000] [--plot lengths.png]
"""

import argparse
import resource
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
import rig  # noqa: E402

import fricjax as fj  # noqa: E402

FREQUENCY = 12.6
SAMPLES, HALF_CYCLES = (500, 20_000), (4, 120)


def record(random: np.random.Generator, samples: int) -> fj.Trace:
    """Make a run by the closed form of Coulomb and viscous friction."""
    # Each half-cycle has at least 20 samples.
    strokes = random.integers(HALF_CYCLES[0], min(HALF_CYCLES[1], samples // 20) + 1)
    duration = strokes / (2 * FREQUENCY)
    t = np.arange(samples) * duration / samples
    # The amplitude falls by a third within the record, so the record ends in motion.
    release, rho = 2e-3, np.exp(-np.pi * 0.0007)
    band = 0.15 * release / strokes
    n = np.floor(2 * FREQUENCY * t)
    amplitude = release * rho**n - (1 + rho) * band * (1 - rho**n) / (1 - rho)
    phase = 2 * np.pi * FREQUENCY * t - np.pi * n
    zeta = 0.0007
    swing = np.exp(-zeta * phase) * (np.cos(phase) + zeta * np.sin(phase))
    x = (-1) ** n * (band + (amplitude - band) * swing)
    return fj.Trace(t, x + 1e-9 * random.standard_normal(samples))


def state() -> tuple[int, int]:
    """Return the number of memory mappings and the memory [MB]."""
    return len(Path("/proc/self/maps").read_text().splitlines()), int(
        Path("/proc/self/statm").read_text().split()[1]
    ) * resource.getpagesize() // 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fits", type=int, default=2000)
    parser.add_argument("--plot", type=Path, help="write a picture over the fits here")
    options = parser.parse_args()
    compiled: list[str] = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, _, **more: compiled.append(event) if event.endswith("backend_compile_duration") else None
    )
    random = np.random.default_rng(0)
    lengths = random.permutation(np.unique(np.linspace(*SAMPLES, options.fits).astype(int)))
    machine = fj.Oscillator(rig.MASS, rig.STIFFNESS, rig.DAMPING, rig.LOAD, fj.friction.Coulomb(rig.MU))
    rows, converged = [], 0
    print(f"{'fits':>6}{'programs':>10}{'mappings':>10}{'memory [MB]':>13}{'converged':>11}")
    for done, samples in enumerate(lengths.tolist(), 1):
        converged += fj.fit(record(random, samples), machine, ("mu", "damping", "stiffness"), throw=False).converged
        rows.append((done, len(compiled), *state()))
        if done % max(lengths.size // 10, 1) == 0:
            print("{:6}{:10}{:10}{:13}".format(*rows[-1]) + f"{converged:11}", flush=True)
    if options.plot:
        draw(np.array(rows), options.plot)


def draw(rows: np.ndarray, file: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(5, 6), layout="constrained")
    for axis, column, name in zip(axes, rows.T[1:], ("programs", "mappings", "memory [MB]"), strict=True):
        axis.plot(rows[:, 0], column)
        axis.set(ylabel=name, ylim=(0, None))
    axes[-1].set_xlabel("fits of different lengths")
    figure.savefig(file)


if __name__ == "__main__":
    main()
