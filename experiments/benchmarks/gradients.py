"""Time derivatives in both modes, and batches of estimates.

The first table gives the CPU seconds of the first derivative of a motion, each in a fresh process without stored
programs. The second gives those of 1,000 releases: `vmap(grad)` against a loop over `jacfwd`, both compiled. The third
gives the time of `vmap(fj.estimate)` over 1,000 records of 2,000 samples, and the largest distance to `fj.fit` in
standard errors for some of them. Run nothing else at the same time.

    python experiments/benchmarks/gradients.py [--only first batch estimate]
"""

import argparse
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

LAWS: dict[str, Callable[[Any], fj.friction.AbstractFriction]] = {
    "Coulomb": lambda mu: fj.friction.Coulomb(mu),
    "Stribeck": lambda mu: fj.friction.Stribeck(mu, 0.065, 5e-3),
    "Tanh": lambda mu: fj.friction.Tanh(mu, 1e-4),
    "LuGre": lambda mu: fj.friction.LuGre(mu, sigma0=1e5, sigma1=284.0),
}
TS = np.linspace(0.0, 0.3, 301)
SIGMA, FITTED = 1e-9, 20
_TIMED = 0.2
"""Shortest time of a measurement [s]."""


def machine(friction: Any, stiffness: float = 2574.0, damping: float = 0.17557) -> fj.Oscillator:
    return fj.Oscillator(0.41068, stiffness, damping, 9.66, friction)


def work(law: str, x0: Any) -> Callable[[Any], Any]:
    return lambda mu: jnp.sum(fj.simulate(machine(LAWS[law](mu)), x0, TS).x ** 2)


def cpu(call: Callable[[], Any]) -> float:
    begun = time.process_time()
    jax.block_until_ready(call())
    return time.process_time() - begun


def first(law: str, mode: str) -> float:
    """Return the CPU seconds of the first derivative in a fresh process."""
    call = f"cpu(lambda: jax.{mode}(work({law!r}, 2e-3))(0.05))"
    script = f"from experiments.benchmarks.gradients import *; fj.progress(False); print({call})"
    environment = os.environ | {"FRICJAX_CACHE_DIR": "off"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)


def batches(law: str) -> tuple[float, float]:
    """Return the CPU seconds of 1,000 derivatives, batched and looped."""
    releases = jnp.linspace(1e-3, 3e-3, 1000)
    batched = jax.jit(jax.vmap(lambda x0: jax.grad(work(law, x0))(0.05)))
    looped = jax.jit(lambda releases: jax.lax.map(lambda x0: jax.jacfwd(work(law, x0))(0.05), releases))
    seconds = []
    for run in (batched, looped):
        jax.block_until_ready(run(releases))
        begun = time.perf_counter()
        jax.block_until_ready(run(releases))
        # The clock of a process is coarse, so short calls are repeated.
        repeats = math.ceil(_TIMED / (time.perf_counter() - begun))
        many = lambda run=run, repeats=repeats: [jax.block_until_ready(run(releases)) for _ in range(repeats)]
        seconds.append(min(cpu(many) for _ in range(3)) / repeats)
    return seconds[0], seconds[1]


def estimates() -> None:
    ts = np.arange(2000) * 1.5e-4
    clean = np.asarray(fj.simulate(machine(fj.friction.Coulomb(0.05)), 2e-3, ts).x)
    records = clean + SIGMA * np.random.default_rng(0).standard_normal((1000, ts.size))
    guess, names = machine(fj.friction.Coulomb(0.051), damping=0.18), ["mu", "damping", "stiffness"]
    run = jax.jit(jax.vmap(lambda x: fj.estimate(x, ts, guess, names, half_cycles=5, sigma=SIGMA)))
    found = jax.block_until_ready(run(records))
    begun = time.perf_counter()
    jax.block_until_ready(run(records))
    print(f"vmap(estimate): {time.perf_counter() - begun:.2f} ms for each of 1,000 records")
    worst = 0.0
    for i, x in enumerate(records[:FITTED]):
        fit = fj.fit((ts, x), guess, names, start="release", noise="white")
        distances = [abs(float(found.values[n][i]) - fit.values[n]) / fit.std_errors[n] for n in found.names]
        worst = max(worst, *distances)
    print(f"converged: {int(found.converged.sum())} of 1000; within {worst:.1e} standard errors of {FITTED} fits")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=["first", "batch", "estimate"])
    only = parser.parse_args(arguments).only or ["first", "batch", "estimate"]
    fj.progress(False)
    if "first" in only:
        print("First derivative, CPU s  jacfwd    grad   ratio")
        for law in LAWS:
            forward, reverse = first(law, "jacfwd"), first(law, "grad")
            print(f"{law:<24} {forward:6.1f}  {reverse:6.1f}  {reverse / forward:6.2f}", flush=True)
    if "batch" in only:
        print("1,000 releases, CPU s    jacfwd    grad   ratio")
        for law in LAWS:
            reverse, forward = batches(law)
            print(f"{law:<24} {forward:6.4f}  {reverse:6.4f}  {reverse / forward:6.2f}", flush=True)
    if "estimate" in only:
        estimates()


if __name__ == "__main__":
    main()
