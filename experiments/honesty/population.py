"""Separate scatter of friction between runs from noise within runs.

Each campaign has 50 runs of one machine under correlated noise, fitted by `fit_batch`. All runs have the same
coefficient of friction, or it scatters by a percent from run to run. The script prints the share of 95 % intervals of
the scatter that contain the true scatter, the same share for the mean, and, for comparison, the share for intervals
that assume white noise. It also prints the number of outliers.

    python experiments/honesty/population.py [--campaigns 200] [--only "AR,narrow"]
"""

import argparse
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import equinox as eqx  # noqa: E402
import numpy as np  # noqa: E402
from records import FREQUENCY, RIGS, Noise, Rig, autoregressive, drift, narrow, random_walk, white  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax.fitting.population import population  # noqa: E402

MU, RUNS, SCATTER = 0.05, 50, 0.01
RIG = Rig("sliding", eqx.tree_at(lambda o: o.friction, RIGS["sliding"].oscillator, fj.friction.Coulomb(MU)),
          ("mu", "damping", "stiffness"), 5e3, 0.65)  # fmt: skip
KINDS: dict[str, Noise] = {
    "white 20 nm": white(20e-9),
    "AR(1) 0.9, 20 nm": autoregressive(0.9, 20e-9),
    "AR(1) 0.99, 20 nm": autoregressive(0.99, 20e-9),
    "random walk 5 nm": random_walk(5e-9),
    "narrow 33 Hz, 100 nm": narrow(33.0, 100e-9),
    f"narrow {FREQUENCY} Hz, 100 nm": narrow(FREQUENCY, 100e-9),
    "drift 1 um/s": drift(1e-6),
}


class Campaign(NamedTuple):
    """Results of one campaign.

    Attributes:
        scatter, mean: True if the interval contains the true value.
        as_white: True if the interval of the scatter under white noise contains the true value.
        outliers: number of runs treated as outliers.
        not_converged: number of fits with another status than "converged".
    """

    scatter: bool
    mean: bool
    as_white: bool
    outliers: int
    not_converged: int


def campaign(noise: Noise, scatter: float, seed: int) -> Campaign:
    random = np.random.default_rng([4, seed])
    traces = []
    for _ in range(RUNS):
        mu = MU * (1 + scatter * random.standard_normal())
        machine = eqx.tree_at(lambda o: o.friction.mu, RIG.oscillator, mu)
        x = np.asarray(fj.simulate(machine, random.choice([-1, 1]) * random.uniform(1.5e-3, 2.6e-3), RIG.t).x)
        traces.append(fj.Trace(RIG.t, noise(RIG, RIG.t, x, random)))
    batch = fj.fit_batch(traces, RIG.oscillator, RIG.free)
    found, as_white = batch.population("mu"), population(batch.values["mu"], batch.white_std_errors["mu"])
    return Campaign(
        *(
            low <= value <= high
            for (low, high), value in ((found.scatter_interval, scatter * MU), (found.interval, MU))
        ),
        as_white.scatter_interval[0] <= scatter * MU <= as_white.scatter_interval[1],
        len(found.outliers),
        int(np.sum(~batch.converged)),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=200)
    parser.add_argument("--only", default="", help="parts of the names of the kinds, separated by commas")
    arguments = parser.parse_args()
    wanted = [part.strip() for part in arguments.only.split(",")]
    print(f"{arguments.campaigns} campaigns of {RUNS} runs a row; shares of the 95 % intervals that contain the truth")
    print(
        f"{'':26s}{'scatter':>8s}{'of scatter':>12s}{'of mean':>9s}{'white noise':>13s}{'outliers':>10s}{'other':>7s}"
    )
    for kind, noise in KINDS.items():
        for scatter in (0.0, SCATTER) if any(part in kind for part in wanted) else ():
            told = [campaign(noise, scatter, seed) for seed in range(arguments.campaigns)]
            shares = [
                float(np.mean([getattr(each, name) for each in told])) for name in ("scatter", "mean", "as_white")
            ]
            lost = [sum(getattr(each, name) for each in told) for name in ("outliers", "not_converged")]
            print(
                f"{kind:26s}{scatter:8.0%}{shares[0]:12.1%}{shares[1]:9.1%}{shares[2]:13.1%}{lost[0]:10d}{lost[1]:7d}",
                flush=True,
            )


if __name__ == "__main__":
    main()
