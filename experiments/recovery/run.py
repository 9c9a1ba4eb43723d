"""Recover known coefficients from noisy runs.

Twenty runs of each law on each rig are fitted from the default start. The script prints one line per workload: largest
error of any free parameter in its standard errors, range of the reduced chi^2, largest relative error of mu, and the
median time of a fit once it is compiled.

    python experiments/recovery/run.py [--seeds 20] [--only rolling-LuGre]
"""

import argparse
import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

STIFFNESS, FREQUENCY, DAMPING_RATIO, X0 = 2574.0, 12.6, 0.0027, 2e-3
MASS = STIFFNESS / (2 * math.pi * FREQUENCY) ** 2
DAMPING = 2 * DAMPING_RATIO * math.sqrt(STIFFNESS * MASS)
SIGMA0 = 1e5


class Workload(NamedTuple):
    """A rig with its record."""

    load: float
    mu: float
    rate: float
    duration: float
    noise: float


WORKLOADS = {
    "rolling": Workload(load=1.89, mu=0.01, rate=5e3, duration=2.0, noise=5e-9),
    "sliding": Workload(load=9.66, mu=0.05, rate=20e3, duration=0.29842, noise=1e-9),
}


class Outcome(NamedTuple):
    """Summary of a set of fits."""

    worst_pull: float
    chi2: tuple[float, float]
    mu_error: float
    seconds: float
    first: float
    converged: int


def oscillator(work: Workload, law: str) -> fj.Oscillator:
    friction = {
        "Coulomb": fj.friction.Coulomb(work.mu),
        "Tanh": fj.friction.Tanh(work.mu, 1e-4),
        "LuGre": fj.friction.LuGre(work.mu, sigma0=SIGMA0, sigma1=1.4 * math.sqrt(SIGMA0 * MASS)),
    }[law]
    return fj.Oscillator(MASS, STIFFNESS, DAMPING, work.load, friction)


def fits(work: Workload, law: str, seeds: int) -> Iterator[tuple[fj.Fit, float]]:
    """Yield each fit with its time [s]."""
    machine = oscillator(work, law)
    t = np.arange(round(work.duration * work.rate)) / work.rate
    clean = np.asarray(fj.simulate(machine, X0, t, accuracy=1e-12).x)
    free = ["mu", "damping", "stiffness"] + (["sigma0"] if law == "LuGre" else [])
    for seed in range(seeds):
        noise = work.noise * np.random.default_rng(seed).standard_normal(t.size)
        begin = time.perf_counter()
        yield (
            fj.fit(fj.Trace(t, clean + noise, sigma=work.noise), machine, free, throw=False),
            time.perf_counter() - begin,
        )


def outcome(work: Workload, law: str, seeds: int) -> Outcome:
    truth = {"mu": work.mu, "damping": DAMPING, "stiffness": STIFFNESS, "sigma0": SIGMA0, "offset": 0.0}
    found = list(fits(work, law, seeds))
    pulls = [abs(f.values[n] - v) / f.std_errors[n] for f, _ in found for n, v in truth.items() if n in f.std_errors]
    ratios, times = [f.chi2_reduced for f, _ in found], [seconds for _, seconds in found]
    return Outcome(
        worst_pull=max(pulls),
        chi2=(min(ratios), max(ratios)),
        mu_error=max(abs(f.values["mu"] / work.mu - 1) for f, _ in found),
        seconds=float(np.median(times[1:] or times)),
        first=times[0],
        converged=sum(f.converged for f, _ in found),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="runs per workload")
    parser.add_argument("--only", default="", help="part of the name of the workloads to run")
    options = parser.parse_args()
    print("workload          converged  worst pull  reduced chi^2  worst rel. error of mu  median fit  first fit")
    for rig, work in WORKLOADS.items():
        for law in ("Coulomb", "Tanh", "LuGre"):
            if options.only in f"{rig}-{law}":
                r = outcome(work, law, options.seeds)
                print(
                    f"{f'{rig}-{law}':<18}{r.converged:>4} of {options.seeds:<3}{r.worst_pull:>9.2f}    "
                    f"{r.chi2[0]:.3f}-{r.chi2[1]:.3f}{r.mu_error:>20.2e}{1e3 * r.seconds:>16.0f} ms{r.first:>9.1f} s"
                )


if __name__ == "__main__":
    main()
