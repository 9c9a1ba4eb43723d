"""Count records that pass as plain, for many kinds of noise.

Records of the rolling rig (Coulomb friction) get each kind of noise of `experiments/honesty/records.py`. A kind is
white if its name begins with "white" and its samples are not rounded. The second table adds disturbances of rising
size to white noise of 5 nm. For those records that pass, it gives the root mean square error of mu, damping and
stiffness in standard errors. The last table repeats the count for other probabilities of a false refusal.

    python experiments/plain/run.py [--runs 500]
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from scipy.signal import lfilter  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "honesty"))

from records import ASIDE, RECORDED, RIGS, SHAKEN, TUNED, Run, motion  # noqa: E402

from fricjax.plain import PlainFits, fit_plain, proof  # noqa: E402

RIG, NOISE, BLOCK = RIGS["rolling"], 5e-9, 20
MACHINE = {name: float(getattr(RIG.oscillator, name)) for name in ("mass", "stiffness", "damping", "normal_force")}
MACHINE["mu"] = float(RIG.oscillator.friction.mu)
KINDS = [kind for kind in {**TUNED, **ASIDE} if kind not in (SHAKEN, RECORDED)]
Disturbance = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


def fits_of(x: list[np.ndarray], sigma: float | None) -> list[PlainFits]:
    """Fit records in blocks, from an inexact machine."""
    start = {**MACHINE, "stiffness": 1.02 * MACHINE["stiffness"], "damping": 1.2 * MACHINE["damping"]}
    made = []
    for begin in range(0, len(x), BLOCK):
        block = np.stack(x[begin : begin + BLOCK])
        machine = {name: np.full(len(block), value) for name, value in start.items()}
        stated = None if sigma is None else np.full(len(block), sigma)
        made.append(fit_plain(block, 1 / RIG.rate, machine, RIG.free, stated))
    return made


def passed(made: list[PlainFits]) -> np.ndarray:
    """Return the numbers of the records that pass."""
    return np.concatenate([BLOCK * number + fits.runs for number, fits in enumerate(made)])


def white(kind: str) -> bool:
    return kind.startswith("white") and "steps" not in kind


def of_kind(kind: str, clean: list[Run]) -> list[np.ndarray]:
    noise = {**TUNED, **ASIDE}[kind]
    return [noise(RIG, run.t, run.x, np.random.default_rng([2, seed])) for seed, run in enumerate(clean)]


def coloured(rho: float, size: float) -> Disturbance:
    drive = size * np.sqrt(1 - rho**2)
    return lambda t, x, random: lfilter([1.0], [1.0, -rho], drive * random.standard_normal(t.size))


def disturbances() -> dict[str, Disturbance]:
    """Return disturbances by name; sizes are in units of the noise."""
    of: dict[str, Disturbance] = {"none": lambda t, x, random: 0 * x}
    for size in (0.1, 0.3, 1.0, 3.0):
        a = size * NOISE
        of[f"hum 50 Hz, {size:g}"] = lambda t, x, random, a=a: a * np.sin(2 * np.pi * (50 * t + random.uniform()))
        of[f"AR(1) 0.9, {size:g}"] = coloured(0.9, a)
        of[f"AR(1) 0.99, {size:g}"] = coloured(0.99, a)
        of[f"drift over the record, {size:g}"] = lambda t, x, random, a=a: a * t / t[-1]
        of[f"error with a period of 0.3 um, {size:g}"] = lambda t, x, random, a=a: a * np.sin(2 * np.pi * x / 316.5e-9)
    for time in (1e-9, 1e-8, 1e-7):
        of[f"jitter {time * 1e9:g} ns"] = lambda t, x, random, s=time: (
            s * np.gradient(x, t) * random.standard_normal(t.size)
        )
    for part in (1e-6, 1e-5, 1e-4):
        of[f"cubic reading {part:g} at 2 mm"] = lambda t, x, random, s=part: s * x * (x / 2e-3) ** 2
    return of


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=500, help="records of each kind")
    runs = parser.parse_args().runs
    clean = [motion(RIG, np.random.default_rng([1, seed])) for seed in range(runs)]
    print(f"{'kind of noise':36} passed  another number of half-cycles  refused by")
    for kind in KINDS:
        made = fits_of(of_kind(kind, clean), None)
        ok = passed(made)
        stops = np.concatenate([fits.at.decay.stop if fits.runs.size else [] for fits in made])
        wrong = sum(int(stop) != clean[run].half_cycles for run, stop in zip(ok, stops, strict=True))
        tests = Counter()
        for fits in made:
            tests.update({name: where.size for name, where in fits.refused.items() if where.size})
        reasons = ", ".join(f"{name} {count}" for name, count in tests.most_common(4))
        print(f"{kind:36} {ok.size:6} {wrong:30}  {reasons}", flush=True)
    print(f"\n{'disturbance':36} passed  rms error in standard errors: mu  damping  stiffness")
    true = np.array([MACHINE[name] for name in RIG.free])
    for name, of in disturbances().items():
        random = np.random.default_rng(3)
        x = [run.x + NOISE * random.standard_normal(run.t.size) + of(run.t, run.x, random) for run in clean]
        made = fits_of(x, NOISE)
        errors = [
            (fits.values[:, :3] - true) / (NOISE * np.sqrt(np.diagonal(fits.inverse, axis1=1, axis2=2))[:, :3])
            for fits in made
            if fits.runs.size
        ]
        size = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0)) if errors else np.full(3, np.nan)
        print(f"{name:36} {passed(made).size:6} {size[0]:32.2f} {size[1]:8.2f} {size[2]:10.2f}", flush=True)
    print("\nchance of a refusal by one test  plain records that pass  others that pass")
    usual = proof.CHANCE
    for chance in (usual / 2, usual, 2 * usual):
        proof.CHANCE = chance
        counts = {kind: passed(fits_of(of_kind(kind, clean), None)).size for kind in KINDS}
        yes, no = (sum(n for kind, n in counts.items() if white(kind) == which) for which in (True, False))
        print(f"{chance:31g} {yes:16} of {runs * sum(map(white, KINDS)):5} {no:17}", flush=True)


if __name__ == "__main__":
    main()
