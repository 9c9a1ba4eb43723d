"""Runs of the prototype rig for the tests of the energy routes."""

import numpy as np

from fricjax.data import Record
from fricjax.friction import AbstractFriction
from fricjax.instrument import synthetic_run
from fricjax.rig import Rig

LOAD, OFFSET = 9.66, 3e-6
RIG = Rig(mass=0.41068, stiffness=2574.0, normal_force=LOAD, damping_ratio=0.0027)


def run(law: AbstractFriction, x0: float, *, rate: float = 20e3, noise: float = 1e-9, rig: Rig = RIG, **more) -> Record:
    """A run from `x0` until well after the stop."""
    settings = {"duration": 0.35, "offset": OFFSET, **more}
    return synthetic_run(rig.oscillator(law), x0, rate=rate, noise=noise, **settings)


def campaign(law: AbstractFriction, low: float, high: float, runs: int, **more) -> list[Record]:
    """Runs from several initial displacements, each with its own noise."""
    return [run(law, x0, seed=seed, **more) for seed, x0 in enumerate(np.linspace(low, high, runs))]
