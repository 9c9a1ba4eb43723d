"""True motions of a rig in closed form, with interferometer noise.

This module does not use fricjax. Under Coulomb friction the mass swings about one end of the dead band for half a
damped period, then about the other end, and so on. It stays at the first reversal within the band.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

STIFFNESS, OMEGA, DAMPING_RATIO = 2574.0, 2 * math.pi * 12.6, 0.0027
MASS = STIFFNESS / OMEGA**2
DAMPING = 2 * DAMPING_RATIO * math.sqrt(STIFFNESS * MASS)
LOADS = (1.89, 9.66)
"""Loads [N]. Above: stiffness [N/m], natural frequency [rad/s], damping ratio, mass [kg], damping [N s/m]."""


def rig_file() -> str:
    """Return the rig file of the machine, without calibration errors.

    The true values of the runs must not depend on such errors.
    """
    machine = {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING, "normal_force": LOADS[0]}
    return "".join(f"{key} = {value!r}\n" for key, value in machine.items())


class Truth(NamedTuple):
    """True values of a run under a load [N], with its sampling.

    The mass is released from `x0` [m] at `hold` [s].
    """

    load: float
    mu: float
    x0: float
    hold: float
    rate: float
    samples: int
    noise: str

    @property
    def t(self) -> np.ndarray:
        return np.arange(self.samples) / self.rate


def free_decay(truth: Truth) -> np.ndarray:
    """Compute displacements about the equilibrium [m] of a run, shape (samples,)."""
    decay = DAMPING / (2 * MASS)
    omega = math.sqrt(OMEGA**2 - decay**2)
    band, half = truth.mu * truth.load / STIFFNESS, math.pi / omega
    t = truth.t - truth.hold
    x, begin, turn = np.full(truth.samples, truth.x0), 0.0, truth.x0
    while abs(turn) > band and begin < t[-1]:
        centre = math.copysign(band, turn)
        after = t >= begin
        phase = omega * (t[after] - begin)
        x[after] = centre + (turn - centre) * np.exp(-decay / omega * phase) * (
            np.cos(phase) + decay / omega * np.sin(phase)
        )
        turn = centre - (turn - centre) * math.exp(-decay * half)
        begin += half
        x[t >= begin] = turn
    return x


WHITE, STEP, MEMORY = 5e-9, 10e-9, 0.8
"""Standard deviation of the noise [m], step of a converter [m], and correlation of the noise of adjacent samples."""


def measured(truth: Truth, random: np.random.Generator) -> np.ndarray:
    """Add a random zero point and noise, like an interferometer."""
    x = free_decay(truth) + random.uniform(-50e-6, 50e-6)
    noise = WHITE * random.standard_normal(truth.samples)
    if truth.noise == "coloured":
        noise = lfilter([math.sqrt(1 - MEMORY**2)], [1.0, -MEMORY], noise)
    return STEP * np.round((x + noise) / STEP) if truth.noise == "quantised" else x + noise
