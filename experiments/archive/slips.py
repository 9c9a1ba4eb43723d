"""Detection rate of fringe-counter slips, and their effect on mu.

Usage: `python experiments/archive/slips.py [--seeds 200]`.

Synthetic runs have slips at known places. Their noise is white, coloured (adjacent samples correlate by 0.9), wandering
(a random walk) or rounded. Rates are 1 to 20 kHz, frequencies 8 to 20 Hz. Each run has five slips of one to five times
six standard deviations of the second difference of its noise. Runs without slips must give no detection. With
`FRICJAX_DATA` the measured pendulums are checked as well, with angles treated as lengths. The last table gives the
effect of one slip of 158.2 nm on mu.
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import fricjax as fj  # noqa: E402
from fricjax.data.dropouts import dropouts  # noqa: E402
from fricjax.data.slips import slips  # noqa: E402
from tests.oracles import coulomb_viscous  # noqa: E402

NOISES = ("white", "coloured", "wandering", "rounded")
SLIPS, FEWEST, APART = 5, 6.0, 40
# The motion is not smooth within BESIDE samples of a kink, nor with COARSE samples per half-cycle or fewer.
BESIDE, COARSE = 16, 100
FRINGE = 158.2e-9


class Run(NamedTuple):
    """Samples of a run without and with slips.

    Attributes:
        t: times [s].
        clean, slipped: displacements [m] without and with slips.
        places: index of the first sample after each slip.
        smooth: True for each slip at which the motion is smooth.
    """

    t: np.ndarray
    clean: np.ndarray
    slipped: np.ndarray
    places: np.ndarray
    smooth: np.ndarray


def make(seed: int, noise: str) -> Run:
    chance = np.random.default_rng(seed)
    rate, frequency = chance.choice([1000, 2000, 5000, 20000]), chance.uniform(8, 20)
    release = chance.uniform(0.03, 0.1)
    t = np.arange(0, 1.2, 1 / rate)
    truth = coulomb_viscous(
        t,
        chance.uniform(0.5e-3, 3e-3),
        frequency=frequency,
        zeta=chance.uniform(1e-3, 1e-2),
        dead_band=10 ** chance.uniform(-5, -4),
        release=release,
    )
    sigma, step = 10 ** chance.uniform(-9.5, -8), 10 ** chance.uniform(-9, -7)
    samples = sigma * coloured(chance.standard_normal(t.size), noise)
    second = float(np.std(np.diff(samples, 2)))
    if noise == "rounded":
        second = float(np.hypot(second, step / np.sqrt(2)))  # the error of rounding is step/sqrt(12), times sqrt(6)
    places = np.sort(chance.choice(np.arange(APART, t.size - APART, APART), SLIPS, replace=False))
    sizes = chance.choice([-1, 1], SLIPS) * FEWEST * second * chance.uniform(1, 5, SLIPS)
    if noise == "rounded":
        sizes = np.sign(sizes) * np.ceil(np.abs(sizes) / step) * step
    clean = np.round((truth.x + samples) / step) * step if noise == "rounded" else truth.x + samples
    slipped = clean + np.sum(sizes[:, None] * (np.arange(t.size) >= places[:, None]), axis=0)
    kinks = np.append(truth.stops, release)
    far = np.abs(t[places][:, None] - kinks).min(axis=1) * rate > BESIDE
    return Run(t, clean, slipped, places, far & (rate / frequency / 2 > COARSE))


def coloured(white: np.ndarray, noise: str) -> np.ndarray:
    if noise == "coloured":
        return np.asarray(lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], white))
    return 0.3 * np.cumsum(white) if noise == "wandering" else white


def count(seeds: int) -> Counter[tuple[str, str]]:
    """Count slips by noise and outcome."""
    counts: Counter[tuple[str, str]] = Counter()
    for noise in NOISES:
        for seed in range(seeds):
            run = make(seed, noise)
            counts[noise, "false on clean"] += len(slips(run.clean)) + len(dropouts(run.t, run.clean))
            found = {slip.index for slip in slips(run.slipped)}
            counts[noise, "false next to slips"] += len(found - set(run.places.tolist()))
            for place, smooth in zip(run.places.tolist(), run.smooth, strict=True):
                where = "smooth" if smooth else "elsewhere"
                counts[noise, where] += 1
                counts[noise, f"found {where}"] += place in found
    return counts


def measured(folder: Path) -> None:
    sources = [(f"rotary-pendulum/data0{i}.txt", {"unit": "deg", "rate": 1000.0}) for i in (1, 2, 3)]
    sources.append(("multiarm-pendulum/SingleDataFreeSwing_1_Dt_0_0001.mat", {"column": "Theta1", "unit": "rad"}))
    several = "multiarm-pendulum/SinglePendulumDataForParameterEstimation.mat"
    cells = (*(f"Y_id[{i}]" for i in range(4)), *(f"Y_vad[{i}]" for i in range(2)))
    sources += [(several, {"column": cell, "unit": "rad", "rate": 1000.0}) for cell in cells]
    print("\nmeasured                                           samples  warn  steps if lengths  dropouts")
    for file, options in sources:
        record = fj.read(folder / file, **options)
        told = [sentence for sentence in fj.data.inspect(record).warnings if "Read it with" in sentence]
        name = f"{Path(file).stem} {options.get('column', '')}"[:49]
        print(
            f"{name:50} {len(record):7} {len(told):5} {len(slips(record.x)):17} {len(fj.data.find_dropouts(record)):9}"
        )


def cost() -> None:
    import jax

    jax.config.update("jax_enable_x64", True)
    machine = {"mass": 0.41068, "stiffness": 2574.0, "damping": 0.1756, "normal_force": 1.89}
    oscillator = fj.Oscillator(**machine, friction=fj.friction.Coulomb(0.01))
    print(f"\none slip of {1e9 * FRINGE:.1f} nm    error of mu, and standard error    repaired              warned")
    for noise in (2e-10, 2e-9, 5e-9):
        for place in (0.3, 0.9, 1.6):
            run = fj.synthetic_run(oscillator, 2e-3, rate=5000.0, duration=3.5, noise=noise, seed=1, hold=0.05)
            slipped = fj.Record(run.t, run.x + FRINGE * (run.t >= place))
            fits = [
                fj.fit(record, oscillator, free=["mu", "damping", "stiffness"])
                for record in (slipped, fj.data.repair_slips(slipped, FRINGE))
            ]
            errors = [f"{fit.values['mu'] / 0.01 - 1:+.1e} +/- {fit.std_errors['mu'] / 0.01:.0e}" for fit in fits]
            told = any("has slipped" in sentence for sentence in fits[0].warnings)
            print(
                f"{1e9 * noise:4.1f} nm, at {place} s   {errors[0]:24}       {errors[1]:22}  {'yes' if told else 'no'}"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    counts = count(parser.parse_args().seeds)
    print("noise       false: clean    near slips   found where smooth   elsewhere (reversals, few samples)")
    for noise in NOISES:
        smooth, elsewhere = (f"{counts[noise, f'found {w}']}/{counts[noise, w]}" for w in ("smooth", "elsewhere"))
        alarms = f"{counts[noise, 'false on clean']:12} {counts[noise, 'false next to slips']:13}"
        print(f"{noise:11} {alarms} {smooth:>20} {elsewhere:>11}")
    if "FRICJAX_DATA" in os.environ:
        measured(Path(os.environ["FRICJAX_DATA"]))
    cost()


if __name__ == "__main__":
    main()
