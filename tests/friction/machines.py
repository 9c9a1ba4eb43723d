"""Machines and motions for the tests of bristle laws.

The tests share them, so that each law is compiled once.
"""

from collections.abc import Mapping

import numpy as np

import fricjax.friction as friction
from experiments.laws.scipy_motion import Machine
from fricjax.oscillator import Motion, Oscillator, simulate

ROLLING = Machine(0.41068, 2574.0, 0.17557, 1.89)  # seven strokes in 0.3 s, still far from rest
SLIDING = Machine(0.41068, 2574.0, 0.17557, 9.66)  # five strokes, then rest with a ringing contact
X0, TS = 2e-3, np.linspace(0, 0.3, 301)
TENTH_OF_A_NANOMETRE = 1e-10


def oscillator(name: str, coefficients: Mapping[str, float], machine: Machine = ROLLING) -> Oscillator:
    return Oscillator(*machine, getattr(friction, name)(**coefficients))


def motion(name: str, coefficients: Mapping[str, float], machine: Machine = ROLLING, x0: float = X0) -> Motion:
    return simulate(oscillator(name, coefficients, machine), x0, TS)
