"""Check the status of fits.

    python experiments/trials/run.py [--runs 10] [--only driven,missing,honest]

"driven" counts driven, beating, pushed and growing motions that a fit describes: there should be none. "missing" counts
motions with a term that the fitted model misses: the status may name this term, another one, or no term.
"honest" counts records of `experiments/honesty` that lose the status "described", or for which a term is named. Records
with outliers are fitted with a robust loss. The columns of time are CPU seconds of the trials.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from scipy.signal import lti  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax.errors import DataError, UsageError  # noqa: E402
from fricjax.fitting import assemble  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "honesty"))

from records import ASIDE, RIGS, TUNED, record  # noqa: E402

FREE = ("mu", "damping", "stiffness")
SPENT: list[float] = []


def unit(**more: object) -> fj.Oscillator:
    """Return a machine of unit mass and load."""
    return fj.Oscillator(1.0, 1.0, 0.0, 1.0, fj.friction.Coulomb(0.01), **more)  # type: ignore[arg-type]


def forced(t: np.ndarray, frequency: float, ratio: float, force: np.ndarray, state: tuple[float, float]) -> np.ndarray:
    """Return the motion of a linear oscillator under a force."""
    omega = 2 * np.pi * frequency
    system = lti([[0.0, 1.0], [-(omega**2), -2 * ratio * omega]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    return system.output(force, t, X0=list(state))[1]


def noisy(x: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return x + 10 ** random.uniform(-5, -2.3) * np.std(x) * random.standard_normal(x.size)


def chirp(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A stage without a spring that follows a chirp."""
    t = np.arange(4000) / 200.0
    f0, f1 = random.uniform(0.5, 1.5), random.uniform(1.6, 4.0)
    swing = 1e-2 * np.exp(-random.uniform(0.0, 0.1) * t)
    return t, swing * np.sin(2 * np.pi * (f0 * t + (f1 - f0) * t**2 / 40.0) + random.uniform(0, 6))


def driven(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A sine force near the resonance, from rest or from a release."""
    t, frequency = np.arange(4000) / 100.0, random.uniform(0.8, 1.2)
    force = random.uniform(0.05, 1.0) * np.cos(2 * np.pi * frequency * random.uniform(0.8, 1.25) * t)
    begin = random.choice([0.0, 1.0]) * 0.05
    return t, forced(t, frequency, random.uniform(5e-4, 0.02), 0.04 * force, (begin, 0.0))


def two_modes(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Two modes, 5 to 30 % apart."""
    t, first = np.arange(6000) / 200.0, 2.0
    second, share = first * (1 + random.uniform(0.05, 0.3)), random.uniform(0.2, 1.0)
    decays = np.exp(-np.outer(random.uniform(0.02, 0.2, 2), t))
    return t, 3e-3 * (decays[0] * np.cos(2 * np.pi * first * t) + share * decays[1] * np.cos(2 * np.pi * second * t))


def pushed(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A decay with a few pushes."""
    t, force = np.arange(4000) / 100.0, np.zeros(4000)
    for at in random.integers(500, 3500, 3):
        force[at : at + 20] += random.choice([-1, 1]) * random.uniform(0.5, 2.0)
    return t, forced(t, 1.0, random.uniform(1e-3, 0.01), force, (0.05, 0.0))


def hand(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A mass that a hand moves at random."""
    t = np.arange(4000) / 100.0
    force = np.convolve(random.standard_normal(4000), np.ones(40) / 40, mode="same")
    return t, forced(t, 1.0, 0.05, 5 * force, (0.02, 0.0))


def growing(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A motion that gains energy."""
    t = np.arange(3000) / 100.0
    return t, forced(t, 1.0, -random.uniform(1e-3, 0.02), np.zeros(3000), (0.01, 0.0))


DRIVEN = (chirp, driven, two_modes, pushed, hand, growing)


def with_drag(random: np.random.Generator) -> tuple[fj.Oscillator, float]:
    return unit(drag=10 ** random.uniform(-2, 0)), 0.1


def pendulum(random: np.random.Generator) -> tuple[fj.Oscillator, float]:
    return unit(drag=random.uniform(3e-3, 3e-2), restoring=fj.restoring.Pendulum()), random.uniform(0.1, 2.5)


def spring(random: np.random.Generator) -> tuple[fj.Oscillator, float]:
    return unit(restoring=fj.restoring.Cubic(random.choice([-1, 1]) * random.uniform(0.01, 0.3) / 0.1**2)), 0.1


def falling(random: np.random.Generator) -> tuple[fj.Oscillator, float]:
    return unit(), 0.1


MISSING: dict[str, Callable[[np.random.Generator], tuple[fj.Oscillator, float]]] = {
    "quadratic drag": with_drag,
    "quadratic drag of a pendulum": pendulum,
    "a spring that": spring,
    "friction that falls": falling,
}


def with_term(kind: str, seed: int) -> tuple[fj.Record, fj.Oscillator]:
    """Return a record with a term, and the machine without it."""
    random = np.random.default_rng([7, seed, len(kind)])
    machine, x0 = MISSING[kind](random)
    band, omega = random.uniform(2e-3, 0.015) * x0, 2 * np.pi * random.uniform(0.7, 1.3)
    law: fj.friction.AbstractFriction = fj.friction.Coulomb(band * omega**2)
    if "falls" in kind:
        law = fj.friction.Stribeck(band * omega**2, 1.3 * band * omega**2, random.uniform(0.02, 0.2) * omega * x0)
    ratio = random.uniform(3e-4, 3e-3)
    drag = float(machine.drag) * (0.1 / x0 if kind == "quadratic drag" else 1.0)
    truth = fj.Oscillator(
        1.0, omega**2, 2 * ratio * omega, 1.0, law, restoring=_scaled(machine.restoring, omega), drag=drag
    )
    motion = fj.simulate(truth, x0, np.arange(5000) / 100.0)
    x = np.asarray(motion.x) + x0 * 10 ** random.uniform(-4.5, -3) * random.standard_normal(5000)
    quantity = "rad" if "pendulum" in kind else "m"
    start = fj.restoring.Pendulum() if quantity == "rad" else fj.restoring.Linear()
    return fj.Record(fj.Trace(np.asarray(motion.t), x), {"quantity": quantity}), unit(restoring=start)


def _scaled(restoring: fj.restoring.AbstractRestoring, omega: float) -> fj.restoring.AbstractRestoring:
    if isinstance(restoring, fj.restoring.Cubic):
        return fj.restoring.Cubic(float(restoring.k3) * omega**2)
    return restoring


def timed() -> None:
    """Record the CPU time of the trials of each fit."""
    alternatives = assemble.alternatives

    def measured(weighted: object) -> list:
        begin = time.process_time()
        result = alternatives(weighted)  # type: ignore[arg-type]
        SPENT.append(time.process_time() - begin)
        return result

    assemble.alternatives = measured  # type: ignore[assignment]


def fitted(data: object, machine: fj.Oscillator, free: tuple[str, ...], **more: str) -> fj.Fit | None:
    """Fit a record, None if it is rejected."""
    try:
        return fj.fit(data, machine, free, throw=False, **more)  # type: ignore[arg-type]
    except (DataError, UsageError) as error:
        print(f"    rejected: {str(error)[:100]}")
        return None


def report_driven(runs: int) -> None:
    for kind in DRIVEN:
        described = 0
        for seed in range(runs):
            random = np.random.default_rng([5, seed])
            t, x = kind(random)
            fit = fitted((t, noisy(x, random)), unit(), FREE)
            if fit is not None and fit.described:
                described += 1
                print(f"    {kind.__name__} {seed}: {fit.status}")
        print(f"{kind.__name__:30s} {described:3d} of {runs} described", flush=True)


def report_missing(runs: int) -> None:
    for kind in MISSING:
        right, named, missed, SPENT[:] = 0, 0, 0, []
        for seed in range(runs):
            fit = fitted(*with_term(kind, seed), FREE)
            status = "" if fit is None else fit.status
            term = kind.removesuffix(" of a pendulum")
            right += term in status.split(" or ")[0]
            if term not in status:
                named += " would (" in status or "small" in status
                missed += " would (" not in status and "small" not in status
                print(f"    {kind} {seed}: {status[:140]}")
        times = _times()
        print(f"{kind:30s} {right:3d} right, {named} other, {missed} no term of {runs}{times}", flush=True)


def report_honest(runs: int) -> None:
    for name, rig in RIGS.items():
        lost, named, total, SPENT[:] = 0, 0, 0, []
        for kind, seed in _honest(runs):
            run = record(rig, kind, seed)
            loss = "cauchy" if "outliers" in kind else "squares"
            fit = fitted((run.t, run.x), rig.oscillator, rig.free, loss=loss)
            if fit is None:
                continue
            total, lost, named = total + 1, lost + (not fit.described), named + (" would (" in fit.status)
            if not fit.described:
                print(f"    {name}, {kind} {seed}: {fit.status[:140]}")
        print(f"{name:30s} {lost:3d} of {total} not described, {named} with a term{_times()}", flush=True)


def _honest(runs: int) -> Iterator[tuple[str, int]]:
    return ((kind, seed) for kind in {**TUNED, **ASIDE} for seed in range(runs))


def _times() -> str:
    spent = np.array(SPENT)
    none = f"; none for {100 * np.mean(spent < 5e-3):.0f} %"
    return f"{none}, median {np.median(spent):.2f} s, most {spent.max():.2f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--only", default="driven,missing,honest")
    options = parser.parse_args()
    timed()
    reports = {"driven": report_driven, "missing": report_missing, "honest": report_honest}
    for name in options.only.split(","):
        print(name)
        reports[name](options.runs)


if __name__ == "__main__":
    main()
