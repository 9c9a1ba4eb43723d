"""Count how often a comparison ranks the true law first.

A campaign is a few runs of the prototype rig with 5 nm of noise, released from different positions. Coefficient of
friction and positions scatter by a percent between campaigns. Each campaign is compared under all laws, and the table
counts the laws that rank first. "Right" is the true law or a law that contains it: Stribeck, Dahl and LuGre contain
Coulomb's law, LuGre contains Dahl's.

    python experiments/compare/run.py [--laws coulomb,stribeck,dahl,lugre] [--truths ...] [--campaigns 50] [--runs 3]
"""

import argparse
import collections
import itertools
import math
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

MASS, STIFFNESS, DAMPING, LOAD = 0.41068, 2574.0, 0.17557, 9.66
MU, V_STRIBECK, SIGMA0 = 0.02, 5e-3, 2e5
SIGMA1 = 1.4 * math.sqrt(SIGMA0 * MASS)
POSITIONS, RATE, DURATION, NOISE = (1.0e-3, 1.4e-3, 1.8e-3), 2000.0, 0.6, 5e-9
CONTAINING = {
    "coulomb": {"coulomb", "stribeck", "dahl", "lugre"},
    "stribeck": {"stribeck"},
    "dahl": {"dahl", "lugre"},
    "lugre": {"lugre"},
}


def machine(law: str, mu: float, wrong: float = 1.0) -> fj.Oscillator:
    """Build the rig under one law.

    `wrong` multiplies the start values of some coefficients.
    """
    laws = fj.friction
    friction = {
        "coulomb": lambda: laws.Coulomb(mu),
        "stribeck": lambda: laws.Stribeck(mu, 1.3 * mu, v_stribeck=wrong * V_STRIBECK),
        "dahl": lambda: laws.Dahl(mu, sigma0=wrong * SIGMA0),
        "lugre": lambda: laws.LuGre(mu, sigma0=wrong * SIGMA0, sigma1=wrong * SIGMA1),
    }[law]()
    return fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, friction)


def campaign(truth: str, number: int, runs: int) -> list[fj.Record]:
    """Make the runs of one campaign."""
    scatter = 1 + 0.01 * np.random.default_rng(number).uniform(-1, 1, 1 + runs)
    true = machine(truth, MU * scatter[0])
    starts = [x0 * part for x0, part in zip(POSITIONS[:runs], scatter[1:], strict=True)]
    settings = {"rate": RATE, "duration": DURATION, "noise": NOISE}
    return [fj.synthetic_run(true, x0, seed=10 * number + i, **settings) for i, x0 in enumerate(starts)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laws", default="coulomb,stribeck,dahl,lugre", help="laws to compare")
    parser.add_argument("--truths", default="", help="laws that make the runs; default: the compared laws")
    parser.add_argument("--campaigns", type=int, default=50, help="campaigns per true law")
    parser.add_argument("--first", type=int, default=0, help="number of the first campaign, which is its seed")
    parser.add_argument("--runs", type=int, default=3, choices=(1, 2, 3), help="runs per campaign")
    parser.add_argument("--held-out", action="store_true", help="also score held-out runs")
    options = parser.parse_args()
    laws = options.laws.split(",")
    wins: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    truths = options.truths.split(",") if options.truths else laws
    for number, truth in itertools.product(range(options.first, options.first + options.campaigns), truths):
        began = time.perf_counter()
        candidates = [machine(law, MU, 0.8) for law in laws]
        found = fj.compare(campaign(truth, number, options.runs), candidates, names=laws, held_out=options.held_out)
        first, *others = (found.row(name) for name in found.ranking)
        wins[truth][first.name] += 1
        behind = ", ".join(f"{row.name} +{row.bic - first.bic:.3g}" for row in others)
        print(
            f"{truth} {number}: {first.name} (chi^2 {first.chi2_reduced:.4g}), BIC {behind}, "
            f"{time.perf_counter() - began:.1f} s",
            flush=True,
        )
    print(f"\n{'true law':<10}" + "".join(f"{law:>10}" for law in laws) + f"{'right':>10}")
    for truth, counts in wins.items():
        right = sum(counts[law] for law in CONTAINING[truth]) / counts.total()
        print(f"{truth:<10}" + "".join(f"{counts[law]:>10}" for law in laws) + f"{right:>10.0%}")


if __name__ == "__main__":
    main()
