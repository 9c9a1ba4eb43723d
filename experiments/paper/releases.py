"""Half-cycles, rest positions and stop times of both machines.

The releases are with and without static friction.
"""

from typing import Any, NamedTuple

import closed_form
import numpy as np
from common import (
    LOAD,
    MASS,
    PROTOTYPE_DAMPING_RATIO,
    PROTOTYPE_MASS,
    PROTOTYPE_STIFFNESS,
    STIFFNESS,
    Number,
    Study,
    oscillator,
)

import fricjax as fj


class Release(NamedTuple):
    """A machine and its start, in SI units."""

    name: str
    mass: float
    stiffness: float
    damping_ratio: float
    mu: float
    mu_s: float
    load: float
    x0: float

    def machine(self) -> fj.Oscillator:
        return oscillator(self.mass, self.stiffness, self.damping_ratio, self.load, self.mu, self.mu_s)


SIMULATED = (MASS, STIFFNESS)
PROTOTYPE = (PROTOTYPE_MASS, PROTOTYPE_STIFFNESS, PROTOTYPE_DAMPING_RATIO)
RELEASES = (
    Release("Fig. 2", *SIMULATED, 0.0, 0.1, 0.1, LOAD, 3e-3),
    Release("Fig. 3", *SIMULATED, 0.0, 0.1, 0.1, LOAD, 1e-3),
    Release("Fig. 9 with 1 % damping", *SIMULATED, 0.01, 0.1, 0.1, LOAD, 3e-3),
    Release("Fig. 9 with 10 % damping", *SIMULATED, 0.1, 0.1, 0.1, LOAD, 3e-3),
    Release("Fig. 2 under standard gravity", *SIMULATED, 0.0, 0.1, 0.1, 9.80665, 3e-3),
    Release("Fig. 2, mu_s = 0.13", *SIMULATED, 0.0, 0.1, 0.13, LOAD, 3e-3),
    Release("Fig. 3, mu_s = 0.13", *SIMULATED, 0.0, 0.1, 0.13, LOAD, 1e-3),
    Release("1 % damping, mu_s = 0.13", *SIMULATED, 0.01, 0.1, 0.13, LOAD, 3e-3),
    Release("sliding prototype", *PROTOTYPE, 0.05, 0.05, 9.66, 1e-3),
    Release("sliding prototype, mu_s = 0.065", *PROTOTYPE, 0.05, 0.065, 9.66, 2e-3),
    Release("rolling prototype, mu = 0.001", *PROTOTYPE, 0.001, 0.001, 1.89, 2e-3),
    Release("rolling prototype, mu = 0.005", *PROTOTYPE, 0.005, 0.005, 1.89, 2e-3),
    Release("from -2.5 mm, 5 % damping, mu_s = 0.12", *SIMULATED, 0.05, 0.1, 0.12, LOAD, -2.5e-3),
)
LATE = np.array([20.0])


def study() -> Study:
    """Simulate all releases."""
    motions = [fj.simulate(release.machine(), release.x0, LATE) for release in RELEASES]
    numbers = [number for pair in zip(RELEASES, motions, strict=True) for number in _numbers(*pair)]
    columns = {
        "Release": [release.name for release in RELEASES],
        "Initial displacement [m]": [release.x0 for release in RELEASES],
        "Half-cycles": [int(motion.n_half_cycles) for motion in motions],
        "Final displacement [m]": [float(motion.x[-1]) for motion in motions],
        "Time of the stop [s]": [float(motion.t_stop) for motion in motions],
    }
    note = (
        "Releases with and without static friction and damping. The picture shows the sizes of all turning points: "
        "each mass reverses until one is at most mu_s N/k."
    )
    return Study("Half-cycles and stops", note, numbers, columns, _picture(motions))


def _numbers(release: Release, motion: fj.Motion) -> tuple[Number, ...]:
    end = closed_form.of(release.machine()).rest(release.x0)
    return (
        Number(f"{release.name}: half-cycles", "", int(motion.n_half_cycles), end.half_cycles),
        Number(f"{release.name}: final displacement", "m", float(motion.x[-1]), end.x),
        Number(f"{release.name}: time of the stop", "s", float(motion.t_stop), end.time),
    )


def _picture(motions: list[fj.Motion]) -> Any:
    picture, axes = fj.show.figure()
    picture.set_figheight(4.6)
    only = axes[0, 0]
    rows = np.arange(len(RELEASES))
    points = [1e3 * np.abs(np.asarray(m.turning_points)[: int(m.n_half_cycles) + 1]) for m in motions]
    only.plot(np.concatenate(points), np.repeat(rows, [p.size for p in points]), ".", markersize=4, label="reversals")
    only.plot([p[-1] for p in points], rows, "o", markersize=6, label="rest")
    limits = [1e3 * closed_form.of(release.machine()).static_band for release in RELEASES]
    only.plot(limits, rows, "|", color="black", markersize=14, label="mu_s N/k")
    only.set_yticks(rows, [f"{release.name}: {p.size - 1}" for release, p in zip(RELEASES, points, strict=True)])
    only.invert_yaxis()
    only.set_xscale("log")
    only.set_xlabel("Size of the turning points [mm]")
    only.set_ylabel("Release: number of half-cycles")
    only.legend(loc="upper left", fontsize=8)
    return picture
