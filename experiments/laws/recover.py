"""Recover the coefficients of every law from noisy runs.

Each law slides on the prototype: 0.41 kg on 2574 N/m, 20 kHz, 1 nm. The fit has the automatic start. Its initial
coefficients are wrong by a factor of three, if the record determines them. The script prints for each coefficient its
true value, the mean and the largest error over the runs in standard errors, and the flags of the fit. It also prints
the seconds of the first fit, which with FRICJAX_CACHE_DIR=off include all compilation.

    python experiments/laws/recover.py [--seeds 5] [--only Dahl LuGre]
"""

import argparse
import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

MASS, STIFFNESS, DAMPING = 0.41068, 2574.0, 0.17557
MACHINE = ("mu", "damping", "stiffness")
WRONG = 3.0


class Run(NamedTuple):
    """Load [N], release [m], duration [s], sampling rate [1/s] and noise [m]."""

    load: float
    x0: float
    duration: float
    rate: float = 20e3
    noise: float = 1e-9


class Workload(NamedTuple):
    """A law with coefficients, free names, run and start."""

    law: Callable[..., Any]
    truth: dict[str, Any]
    free: tuple[str, ...]
    run: Run
    start: str = "first_reversal"


SLIDING = Run(load=9.66, x0=2e-3, duration=0.32)
ROLLING = Run(load=1.89, x0=2e-4, duration=0.6)
SIGMA0 = 1e6
SIGMA1 = 0.6 * math.sqrt(SIGMA0 * MASS)

KNOTS, FORCES = (0.0, 0.02, 0.06, 0.15), tuple(f"forces_{i}" for i in range(4))

WORKLOADS = {
    "Coulomb": Workload(fj.friction.Coulomb, {"mu": 0.05}, MACHINE, SLIDING),
    "Tanh": Workload(fj.friction.Tanh, {"mu": 0.05, "v_s": 1e-4}, (*MACHINE, "v_s"), SLIDING),
    "Stribeck": Workload(
        fj.friction.Stribeck, {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 0.02}, (*MACHINE, "mu_s", "v_stribeck"), SLIDING
    ),
    "Lorentzian": Workload(
        fj.friction.Lorentzian,
        {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 0.02},
        (*MACHINE, "mu_s", "v_stribeck"),
        SLIDING,
    ),
    "LuGre": Workload(
        fj.friction.LuGre, {"mu": 0.05, "sigma0": SIGMA0, "sigma1": SIGMA1}, (*MACHINE, "sigma0", "sigma1"), SLIDING
    ),
    "LuGre, soft": Workload(
        fj.friction.LuGre, {"mu": 0.01, "sigma0": 1e5, "sigma1": 120.0}, (*MACHINE, "sigma0", "sigma1"), ROLLING
    ),
    "LuGre, falling": Workload(
        fj.friction.LuGre,
        {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 0.02, "sigma0": SIGMA0, "sigma1": SIGMA1},
        (*MACHINE, "mu_s", "v_stribeck", "sigma0", "sigma1"),
        SLIDING,
    ),
    "Makkar": Workload(
        fj.friction.Makkar,
        {"gamma1": 0.01, "gamma2": 3e3, "gamma3": 50.0, "gamma4": 0.05, "gamma5": 5e3},
        ("gamma1", "gamma3", "gamma4", "gamma5", "damping", "stiffness"),
        SLIDING,
    ),
    "Viscous": Workload(
        lambda mu, sigma2: fj.friction.Coulomb(mu) + fj.friction.Viscous(sigma2),
        {"mu": 0.05, "sigma2": 0.3},
        ("mu", "sigma2", "stiffness"),
        SLIDING,
    ),
    "QuadraticDrag": Workload(
        lambda mu, drag: fj.friction.Coulomb(mu) + fj.friction.QuadraticDrag(drag),
        {"mu": 0.05, "quadratic_drag": 1.0},
        (*MACHINE, "quadratic_drag"),
        SLIDING,
    ),
    "LoadDependent": Workload(
        fj.friction.LoadDependent, {"mu": 0.05, "exponent": 2 / 3, "reference_load": 10.0}, MACHINE, SLIDING
    ),
    "Ageing": Workload(fj.friction.Ageing, {"mu": 0.05, "beta": 1e-3, "dwell": 60.0, "mu_s": 0.055}, MACHINE, SLIDING),
    "Spline": Workload(
        fj.friction.Spline, {"knots": KNOTS, "forces": (0.06, 0.052, 0.05, 0.054)}, (*FORCES, "stiffness"), SLIDING
    ),
    "MonotoneSpline": Workload(
        fj.friction.MonotoneSpline,
        {"knots": KNOTS, "forces": (0.06, 0.052, 0.05, 0.049)},
        (*FORCES, "stiffness"),
        SLIDING,
    ),
    "Dahl": Workload(fj.friction.Dahl, {"mu": 0.05, "sigma0": SIGMA0}, (*MACHINE, "sigma0"), SLIDING),
    "ElastoPlastic": Workload(
        fj.friction.ElastoPlastic,
        {"mu": 0.05, "sigma0": SIGMA0, "sigma1": SIGMA1, "breakaway_fraction": 0.6},
        (*MACHINE, "sigma0", "sigma1", "breakaway_fraction"),
        SLIDING,
    ),
    "BoucWen": Workload(
        fj.friction.BoucWen, {"mu": 0.05, "sigma0": SIGMA0, "n": 2.0, "beta": 0.7}, (*MACHINE, "sigma0"), SLIDING
    ),
    "BoucWen, shape": Workload(
        fj.friction.BoucWen,
        {"mu": 0.05, "sigma0": 1e5, "n": 2.0, "beta": 0.7},
        (*MACHINE, "sigma0", "n", "beta"),
        SLIDING,
    ),
    "Jenkins": Workload(fj.friction.Jenkins, {"mu": 0.05, "sigma0": SIGMA0}, (*MACHINE, "sigma0"), SLIDING),
    "BlimanSorine": Workload(
        fj.friction.BlimanSorine,
        {"mu1": 0.07, "mu2": 0.02, "eta": 0.3, "epsilon": 1e-4},
        ("mu1", "mu2", "eta", "epsilon", "damping", "stiffness"),
        SLIDING,
    ),
    "MaxwellSlip": Workload(
        fj.friction.MaxwellSlip,
        {"stiffnesses": (4e4, 2e4), "limits": (0.02, 0.03)},
        ("stiffnesses_0", "stiffnesses_1", "limits_0", "limits_1", "damping", "stiffness"),
        SLIDING,
    ),
    "GeneralisedMaxwellSlip": Workload(
        fj.friction.GeneralisedMaxwellSlip,
        {
            "mu": 0.05,
            "mu_s": 0.06,
            "v_stribeck": 0.02,
            "stiffnesses": (4e4, 2e4),
            "shares": (0.4,),
            "attraction": 300.0,
        },
        (*MACHINE, "mu_s", "v_stribeck", "stiffnesses_0", "stiffnesses_1"),
        SLIDING,
    ),
    "Leuven": Workload(
        fj.friction.Leuven,
        {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 0.02, "stiffnesses": (4e4, 2e4), "shares": (0.4,), "sigma1": 50.0},
        (*MACHINE, "mu_s", "v_stribeck", "stiffnesses_0", "stiffnesses_1", "sigma1"),
        SLIDING,
        start="release",
    ),
    "RateState": Workload(
        fj.friction.RateState,
        {"mu": 0.05, "a": 2e-3, "b": 1e-3, "slip_distance": 1e-5},
        (*MACHINE, "b"),
        SLIDING,
    ),
    "RateStateSlip": Workload(
        fj.friction.RateStateSlip,
        {"mu": 0.05, "a": 2e-3, "b": 1e-3, "slip_distance": 1e-5},
        (*MACHINE, "b"),
        SLIDING,
    ),
    "Rolling": Workload(fj.friction.Rolling, {"mu": 0.05, "length": 5e-5}, (*MACHINE, "length"), SLIDING),
}
# A record determines these coefficients, so the fit starts from wrong values. The others start from the truth.
TOLD = ("mu", "mu_s", "sigma0", "sigma1", "length", "epsilon", "mu1", "stiffnesses", "limits", "gamma4", "forces")


class Row(NamedTuple):
    """Errors and flags of one coefficient over the seeds."""

    name: str
    truth: float
    mean: float
    worst: float
    flags: str


def oscillator(work: Workload, wrong: float = 1.0) -> fj.Oscillator:
    """Build the machine with the law.

    `wrong` multiplies the coefficients that the record determines.
    """
    given = {name: _times(value, wrong) if name in TOLD else value for name, value in work.truth.items()}
    damping = DAMPING * (wrong if "damping" in work.free else 1.0)
    return fj.Oscillator(MASS, STIFFNESS, damping, work.run.load, work.law(**given))


def _times(value: float | tuple[float, ...], factor: float) -> Any:
    return tuple(factor * each for each in value) if isinstance(value, tuple) else factor * value


def _named(truth: dict[str, Any]) -> dict[str, float]:
    """Return values by the names of their parameters.

    Names of elements end with their index.
    """
    lists = {
        f"{name}_{i}": each for name, value in truth.items() if isinstance(value, tuple) for i, each in enumerate(value)
    }
    return {name: value for name, value in truth.items() if not isinstance(value, tuple)} | lists


def traces(work: Workload, seeds: int) -> list[fj.Trace]:
    """Simulate noisy records of one motion."""
    run = work.run
    t = np.arange(round(run.duration * run.rate)) / run.rate
    clean = np.asarray(fj.simulate(oscillator(work), run.x0, t, accuracy=1e-12).x)
    noise = [np.random.default_rng(seed).standard_normal(t.size) for seed in range(seeds)]
    return [fj.Trace(t, clean + run.noise * each, sigma=run.noise) for each in noise]


def rows_of(work: Workload, fits: list[fj.Fit]) -> list[Row]:
    truth = {"damping": DAMPING, "stiffness": STIFFNESS, **_named(work.truth)}
    rows = []
    for name in work.free:
        pulls = np.array([(f.values[name] - truth[name]) / f.std_errors[name] for f in fits])
        flags = sorted({flag for f in fits for flag in f.flags[name]})
        rows.append(Row(name, truth[name], float(pulls.mean()), float(np.abs(pulls).max()), "; ".join(flags)))
    return rows


def report(name: str, work: Workload, seeds: int) -> None:
    records, fits, ends = traces(work, seeds), [], [time.perf_counter()]
    for trace in records:
        fits.append(fj.fit(trace, oscillator(work, WRONG), work.free, start=work.start, throw=False))
        ends.append(time.perf_counter())
    states = sorted({f.status.split(":")[0] for f in fits})
    good = sum(f.converged for f in fits)
    ratio = max(f.chi2_reduced for f in fits)
    first, last = ends[1] - ends[0], ends[-1] - ends[0]
    print(
        f"\n{name}: {good} of {seeds} converged ({'; '.join(states)}), reduced chi^2 up to {ratio:.3g}, "
        f"{np.median([f.passes for f in fits]):.0f} passes, {last:.1f} s, the first {first:.1f}"
    )
    for row in rows_of(work, fits):
        print(f"  {row.name:<20}{row.truth:>12.6g}{row.mean:>10.2f}{row.worst:>10.2f}   {row.flags}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="runs of each law")
    parser.add_argument("--only", nargs="+", default=list(WORKLOADS), help="names of the laws to recover; default: all")
    options = parser.parse_args()
    print("law, coefficient           truth      mean     worst   flags (errors in standard errors)")
    for name in options.only:
        report(name, WORKLOADS[name], options.seeds)


if __name__ == "__main__":
    main()
