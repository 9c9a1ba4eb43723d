"""Prototype of the paper with its two contacts."""

from fricjax.friction.base import AbstractFriction
from fricjax.oscillator import Oscillator
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

STIFFNESS, SLIDING, ROLLING = 2574.0, 9.66, 1.89
STATE = ("x0", "t_release", "offset")


def prototype(law: AbstractFriction, load: float = SLIDING) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, load, law)
