"""Check fits of pendulums with small and large swings.

A fit must end at the true optimum, in few stages, and with a numerical error far below the noise. Forty simulated
pendulums have random dry friction, damping and drag (first swing 0.3 to 3.05 rad, 20 to 260 half-cycles, 2 mrad of
noise, 100 Hz). Each is fitted from the default start and, for comparison, from the truth. Further fits cover a pendulum
that starts near the top and, if FRICJAX_DATA names their folder, measured pendulums. The script prints one line per fit
and the number of broken requirements.

    FRICJAX_DATA=... python experiments/honesty/pendulums.py [--count 40] [--only simulated|top|measured]
"""

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

NOISE, RATE = 2e-3, 100.0
FREE = ("mu", "damping", "drag", "stiffness")
# Limits for a fit: chi^2 minus that of the fit from the truth, range of the reduced chi^2, numerical error in standard
# errors, stages, and seconds of a compiled fit.
WORSE, RANGE, SHIFT, STAGES, SECONDS = 1e-3, (0.95, 1.05), 0.1, 3, 0.5
# Residuals [rad] and stages of fits of the measured pendulums without the envelope of reversals.
BEFORE = {
    ("small swing", "viscous"): (2.2080e-3, 2),
    ("small swing", "dry"): (5.6035e-4, 4),
    ("small swing", "dry + viscous"): (5.3172e-4, 4),
    ("large swing", "viscous"): (2.7954e-2, 4),
    ("large swing", "dry + viscous"): (1.8404e-2, 2),
    ("large swing", "with drag, c >= 0"): (7.3900e-3, 2),
    ("large swing", "with drag"): (2.7560e-3, 9),
    ("rotary 3", "viscous"): (2.1926e-2, 2),
    ("rotary 3", "dry + viscous"): (3.7987e-3, 5),
    ("rotary 1", "viscous"): (1.5433e-2, 5),
    ("rotary 1", "dry + viscous"): (6.0980e-3, 4),
    ("rotary 2", "viscous"): (1.4411e-2, 8),
    ("rotary 2", "dry + viscous"): (9.8530e-3, 4),
}


class Swing(NamedTuple):
    """A pendulum with its record.

    Friction, damping and drag are per unit inertia.
    """

    stiffness: float
    friction: float
    damping: float
    drag: float
    x0: float
    duration: float

    @property
    def machine(self) -> fj.Oscillator:
        return pendulum(self.stiffness, self.friction, self.damping, self.drag)


def pendulum(stiffness: float, friction: float, damping: float, drag: float) -> fj.Oscillator:
    law = fj.friction.Coulomb(friction)
    return fj.Oscillator(1.0, stiffness, damping, 1.0, law, restoring=fj.restoring.Pendulum(), drag=drag)


def swings(count: int) -> Iterator[Swing]:
    """Draw random pendulums with a given number of half-cycles.

    Random shares divide the loss between friction, damping and drag.
    """
    random = np.random.default_rng(7)
    for _ in range(count):
        x0, n = random.uniform(0.3, 3.05), np.exp(random.uniform(np.log(20), np.log(260)))
        stiffness = random.uniform(20.0, 60.0)
        shares = random.dirichlet([2.0, 1.0, 1.0])
        omega, height = np.sqrt(stiffness), 2 * np.sin(x0 / 2)
        # Each loss alone would reduce the swing to a tenth within n half-cycles.
        friction = shares[0] * stiffness * height**2 / 2 / (n * x0)
        damping, drag = shares[1] * 2 * omega * np.log(10) / (np.pi * n), shares[2] * 9 * 0.75 / (n * height)
        yield Swing(stiffness, friction, damping, drag, x0, round(1.1 * n * np.pi / omega + 2.0))


TOP = Swing(30.857, 0.21557, 0.00368, 0.00178, 2.95, 68.0)


def record(swing: Swing, seed: int, rate: float = RATE, noise: float = NOISE) -> fj.Trace:
    t = np.arange(round(swing.duration * rate)) / rate
    clean = np.asarray(fj.simulate(swing.machine, swing.x0, t, accuracy=1e-12).x)
    return fj.Trace(t, clean + noise * np.random.default_rng(seed).standard_normal(t.size), sigma=noise)


def judged(swing: Swing, trace: fj.Trace) -> tuple[str, list[str]]:
    """Fit a simulated pendulum; return a line and its failed checks."""
    start = pendulum(50.0, 0.1, 0.0, 0.0)
    begin = time.perf_counter()
    fj.fit(trace, start, FREE, throw=False)
    first, begin = time.perf_counter() - begin, time.perf_counter()
    found = fj.fit(trace, start, FREE, throw=False)
    seconds = time.perf_counter() - begin
    truth = {"mu": swing.friction, "damping": swing.damping, "drag": swing.drag, "stiffness": swing.stiffness}
    best = fj.fit(trace, start, FREE, guess=truth, throw=False)
    kept = {
        "converged": found.described,
        "true optimum": found.chi2 <= best.chi2 + WORSE,
        "chi^2": RANGE[0] <= found.chi2_reduced <= RANGE[1],
        "numerical error": found.numerical_shift <= SHIFT,
        "stages": found.stages <= STAGES,
        "time": seconds <= SECONDS,
    }
    line = (
        f"{swing.x0:5.2f} rad {found.half_cycles[0] or 0:4d} half-cycles  chi^2 {found.chi2_reduced:7.4f} "
        f"({found.chi2 - best.chi2:+9.2e})  shift {found.numerical_shift:8.1e}  {found.stages:2d} stages "
        f"{found.iterations:3d} steps {seconds:6.3f} s, {first:5.1f} s at first"
    )
    return line, [name for name, good in kept.items() if not good]


def simulated(count: int) -> list[str]:
    failed = []
    for i, swing in enumerate(swings(count)):
        try:
            line, lost = judged(swing, record(swing, i))
        except fj.DataError as error:
            line, lost = f"{swing.x0:5.2f} rad {error}", ["segmentation"]
        print(f"{i:3d} {line}  {', '.join(lost)}", flush=True)
        if lost:
            print(f"    {swing}", flush=True)
        failed += [f"{i}: {name}" for name in lost]
    return failed


def top() -> list[str]:
    line, lost = judged(TOP, record(TOP, 0, 150.0, 1e-3))
    print(f"top {line}  {', '.join(lost)}", flush=True)
    return [f"top: {name}" for name in lost]


def measured(folder: Path) -> list[str]:
    from experiments.measured.run import FILES, FITS

    failed = []
    for run, name, model in FITS:
        file, options = FILES[run]
        start = pendulum(50.0, 0.1 if "mu" in model.free else 0.0, 0.0, 0.0)
        found = fj.fit(fj.read(folder / file, **options), start, model.free, bounds=model.bounds, throw=False)
        rms, stages = BEFORE[run, name]
        kept = {"rms": found.residual_rms <= 1.002 * rms, "stages": found.stages <= STAGES}
        lost = [what for what, good in kept.items() if not good]
        print(
            f"{run:<12} {name:<18} rms {found.residual_rms:.3e} rad (before {rms:.3e})  {found.stages} stages (before "
            f"{stages})  {found.half_cycles[0] or 0} half-cycles, {found.iterations} steps  {', '.join(lost)}",
            flush=True,
        )
        failed += [f"{run}, {name}: {what}" for what in lost]
    return failed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="number of simulated pendulums")
    parser.add_argument("--only", choices=("simulated", "top", "measured"), help="part of the study")
    options = parser.parse_args()
    failed = []
    if options.only in (None, "simulated"):
        failed += simulated(options.count)
    if options.only in (None, "top"):
        failed += top()
    folder = os.environ.get("FRICJAX_DATA")
    if options.only in (None, "measured") and folder:
        failed += measured(Path(folder))
    print(f"{len(failed)} not kept" + "".join(f"\n  {entry}" for entry in failed))


if __name__ == "__main__":
    main()
