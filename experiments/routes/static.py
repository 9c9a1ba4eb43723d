"""Campaigns for the static coefficient: stops without and with scatter.

The motions come from the half-cycle map in plain Python.
"""

import numpy as np

import fricjax as fj
from fricjax.errors import DataError
from fricjax.pairs import bracket, probit

MASS, STIFFNESS, LOAD, MU = 0.41068, 2574.0, 9.66, 0.05
BAND = MU * LOAD / STIFFNESS
STATIC = 1.3 * BAND
# Expected median width of the bracket in dead bands, by number of runs, for releases from 0.9 to 12 dead bands.
WIDTHS = {5: 0.53, 10: 0.30, 20: 0.15, 40: 0.074, 80: 0.036}


def _amplitudes(a0: float, band: float, static: float, scatter: float, random: np.random.Generator) -> list[float]:
    """Compute the deflections at zero velocity of one undamped run.

    The last one is the stop.
    """
    points = [a0]
    while abs(points[-1]) > static + scatter * random.standard_normal():
        points.append(abs(points[-1]) - 2 * band)
    return points


def bracketed() -> dict[str, dict[str, float]]:
    """Measure width and coverage of the bracket in 200 campaigns per size."""
    machine, told = fj.Oscillator(MASS, STIFFNESS, 0.0, LOAD, fj.friction.Coulomb(MU)), {}
    for runs, expected in WIDTHS.items():
        random, widths, held = np.random.default_rng(runs), [], 0
        for _ in range(200):
            made = [_amplitudes(a, BAND, STATIC, 0.0, random) for a in random.uniform(0.9, 12, runs) * BAND]
            counts = np.array([len(points) - 1 for points in made])
            ends = np.array([(-1) ** (len(points) - 1) * points[-1] for points in made])
            interval = bracket(machine, np.array([points[0] for points in made]), ends, counts)
            held += interval.lower_band <= STATIC * (1 + 1e-12) and interval.upper_band >= STATIC * (1 - 1e-12)
            widths.append((interval.upper_band - interval.lower_band) / BAND)
        told[str(runs)] = {"held": held / 200, "width": float(np.median(widths)), "expected": expected}
        print(
            f"bracket, {runs:3d} runs: holds the truth in {held} of 200, "
            f"median width {np.median(widths):.3f} x_d (expected {expected})"
        )
    return told


def coverage(campaigns: int, runs: int = 40, scatter: float = 0.15) -> dict[str, float]:
    """Measure the coverage of the 95 % interval of the static band."""
    random, covered, tried, apart = np.random.default_rng(1), 0, 0, 0
    while tried < campaigns:
        made = [_amplitudes(a, BAND, STATIC, scatter * BAND, random) for a in random.uniform(1.5, 12, runs) * BAND]
        size = np.abs(np.concatenate(made))
        stopped = np.concatenate([np.arange(len(points)) == len(points) - 1 for points in made])
        try:
            estimate = probit(size, stopped)
        except DataError:
            apart += 1
            continue
        tried += 1
        covered += estimate.interval[0] <= STATIC <= estimate.interval[1]
    print(
        f"probit: {covered / tried:.1%} of {tried} intervals at 95 % hold the truth ({apart} campaigns without overlap)"
    )
    return {"coverage": covered / tried, "campaigns": tried, "without_overlap": apart}
