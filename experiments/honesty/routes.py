"""Error bars of routes 2 to 4 over many campaigns.

The prototype rig (mu = 0.05, damping ratio 0.27 %) is released from 1.2 to 12 dead bands, to both sides or to one, with
an offset and a scatter of 0.1 um of each final displacement. The script prints the share of the 95 and 68 % intervals
of mu that contain the truth, and the standard deviation of the errors in standard errors, as normal scores of their
Student distribution. It also prints the number of campaigns that report open numbers of half-cycles, and the number of
campaigns with wrong numbers of half-cycles and no report. Campaigns with open numbers do not count in the intervals.
The same table covers the mean of all routes and the probability of a stop.

    python experiments/honesty/routes.py [--campaigns 400] [--only pairs|stated|energy|agreement|probit]
"""

import argparse
import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from scipy.stats import norm, t  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax import (  # noqa: E402
    compare_routes,
    fit_final_displacements,
    fit_triangle_map,
    half_cycle_friction,
)
from fricjax.errors import DataError  # noqa: E402
from fricjax.pairs import RouteFit, probit  # noqa: E402

MASS, STIFFNESS, DAMPING_RATIO, LOAD, MU = 0.41068, 2574.0, 0.0027, 9.66, 0.05
DAMPING = 2 * DAMPING_RATIO * np.sqrt(MASS * STIFFNESS)
DAMPED = float(np.exp(-np.pi * DAMPING_RATIO / np.sqrt(1 - DAMPING_RATIO**2)))
RIG = fj.Rig(mass=MASS, stiffness=STIFFNESS, damping=DAMPING, normal_force=LOAD)
BAND = MU * LOAD / STIFFNESS
NOISE = 1e-7
SIZES = (4, 6, 8, 12, 16, 24, 40)


class Outcome(NamedTuple):
    """Result of one campaign.

    Attributes:
        score: error in normal scores.
        is_open: the campaign reports open numbers of half-cycles.
        wrong: the numbers are wrong and the campaign does not report it.
    """

    score: float
    is_open: bool
    wrong: bool


def released(y0: float, static: float = BAND) -> tuple[float, int]:
    """Return final displacement and number of half-cycles by the half-cycle map."""
    side, a, n = np.sign(y0), abs(y0), 0
    while a > static:
        a, n = DAMPED * a - (1 + DAMPED) * BAND, n + 1
    return float(side * (-1) ** n * a), n


def campaign(pairs: int, seed: int, sides: Sequence[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw initial and final displacements and numbers of half-cycles."""
    random = np.random.default_rng([pairs, seed])
    y0 = random.uniform(1.2, 12, pairs) * BAND * random.choice(sides, pairs)
    offset, static = random.uniform(-3e-6, 3e-6), BAND * random.uniform(1, 1.3)
    ends, counts = zip(*(released(y, static) for y in y0), strict=True)
    return y0 + offset, np.array(ends) + offset + NOISE * random.standard_normal(pairs), np.array(counts)


def score(error: float, std: float, dof: float) -> float:
    """Convert an error to the normal score of the same probability.

    The error is in standard errors of a Student distribution with `dof` degrees of freedom.
    """
    return float(norm.ppf(np.clip(t.cdf(error / std, dof), 1e-300, 1 - 1e-16)))


def by_pairs(route: int, sides: Sequence[float], known: bool, stated: float | None, job: tuple[int, int]) -> Outcome:
    """Fit one campaign of pairs by route 2 or 3."""
    x0, xf, counts = campaign(*job, sides)
    numbers = counts if known else None
    if route == 2:
        sigma = None if stated is None else NOISE * stated
        fit = fit_final_displacements(
            x0, xf, RIG.oscillator(fj.friction.Coulomb(0.03)), sigma=sigma, half_cycles=numbers
        )
    else:
        fit = fit_triangle_map(x0, xf, RIG, half_cycles=numbers)
    said = any("half-cycles" in sentence for sentence in fit.warnings)
    wrong = not np.array_equal(fit.half_cycles, counts)
    return Outcome(_score(fit), said, wrong and not said)


def _score(fit: RouteFit) -> float:
    half = (fit.intervals["mu"][1] - fit.intervals["mu"][0]) / 2
    normal = fit.sigma_source == "given" and half < 1.97 * fit.std_errors["mu"]
    return score(fit.values["mu"] - MU, fit.std_errors["mu"], 1e9 if normal else fit.dof)


def recorded(noise: float, runs: int, seed: int) -> list[fj.Record]:
    """Simulate records of the same machine from different releases."""
    random = np.random.default_rng([runs, seed])
    machine = RIG.oscillator(fj.friction.Coulomb(MU))
    how = {"rate": 5e3, "duration": 0.4, "noise": noise, "offset": 3e-6}
    return [
        fj.synthetic_run(machine, x0, seed=1000 * seed + i, **how)
        for i, x0 in enumerate(random.uniform(0.9e-3, 2e-3, runs))
    ]


def by_agreement(noise: float, job: tuple[int, int]) -> Outcome:
    """Combine all routes on the same records."""
    fit = compare_routes(recorded(noise, *job), RIG)
    return Outcome((fit.mu.value - MU) / fit.mu.std, False, False)


def by_energy(noise: float, job: tuple[int, int]) -> Outcome:
    """Apply route 4 to the reversals of records."""
    fit = half_cycle_friction(recorded(noise, *job), RIG)
    return Outcome((fit.mu.value - MU) / fit.mu.std, False, False)


def by_stops(job: tuple[int, int]) -> Outcome:
    """Estimate the static band from stops with scattered static friction.

    The scatter is 15 % of the dead band.
    """
    random, size, stopped = np.random.default_rng(job), [], []
    for a in random.uniform(1.31, 12, job[0]) * BAND:
        while True:
            size.append(abs(a))
            stopped.append(abs(a) <= (1.3 + 0.15 * random.standard_normal()) * BAND)
            if stopped[-1]:
                break
            a = abs(a) - 2 * BAND
    try:
        fit = probit(np.array(size), np.array(stopped))
    except DataError:
        return Outcome(np.nan, True, False)
    below, above = (abs(end - fit.static_band) / norm.ppf(0.975) for end in fit.interval)
    off = fit.static_band - 1.3 * BAND
    return Outcome(float(off / (below if off > 0 else above)), False, fit.scatter <= 0)


def report(name: str, one: Callable[[tuple[int, int]], Outcome], sizes: Sequence[int], campaigns: int) -> None:
    """Print one line for each size of a campaign."""
    with ProcessPoolExecutor() as pool:
        for pairs in sizes:
            outcomes = list(pool.map(one, [(pairs, seed) for seed in range(campaigns)], chunksize=25))
            z = np.array([each.score for each in outcomes if not each.is_open])
            sure = f"{np.mean(np.abs(z) < norm.ppf(0.975)):6.1%} {np.mean(np.abs(z) < 1):6.1%}  {np.std(z):4.2f}"
            still_open, wrong = (sum(getattr(each, field) for each in outcomes) for field in ("is_open", "wrong"))
            print(
                f"{name:44s} {pairs:3d}  {sure if z.size else '   none left   '}  {still_open:4d} {wrong:4d}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=400)
    parser.add_argument("--only", choices=["pairs", "stated", "energy", "agreement", "probit"])
    options = parser.parse_args()
    print(f"{'':44s}   n    95 %   68 %    sd  open  wrong in silence")
    wanted = lambda name: options.only in (None, name)
    both, one = (-1.0, 1.0), (1.0,)
    if wanted("pairs"):
        for route in (2, 3):
            for sides, side in ((both, "both sides"), (one, "one side")):
                for known, what in ((False, "numbers counted"), (True, "numbers known")):
                    job = functools.partial(by_pairs, route, sides, known, None)
                    report(f"route {route}, {side}, {what}", job, SIZES, options.campaigns)
    if wanted("stated"):
        for stated in (1.0, 0.2):
            job = functools.partial(by_pairs, 2, both, True, stated)
            report(f"route 2, noise stated as {stated:g} of the true", job, SIZES, options.campaigns)
    if wanted("energy"):
        for noise in (1e-9, 1e-7):
            report(f"route 4, {1e9 * noise:g} nm", functools.partial(by_energy, noise), (4, 8, 16), options.campaigns)
    if wanted("agreement"):
        for noise in (1e-9, 1e-8):
            report(f"all routes, {1e9 * noise:g} nm", functools.partial(by_agreement, noise), (6,), options.campaigns)
    if wanted("probit"):
        report("probability of a stop", by_stops, (20, 40, 80), options.campaigns)


if __name__ == "__main__":
    main()
