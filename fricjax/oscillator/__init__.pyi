from . import restoring
from .energy import Energy, energy
from .engines import Exact, Hybrid, Smooth
from .motion import Motion, Start
from .oscillator import Oscillator
from .program import Program
from .release import AbstractRelease, ExponentialRelease
from .results import RESULTS, is_successful
from .rosenbrock import Rodas5P
from .session import ready
from .simulate import final_displacement, simulate, starting_state

__all__ = [
    "RESULTS",
    "AbstractRelease",
    "Energy",
    "Exact",
    "ExponentialRelease",
    "Hybrid",
    "Motion",
    "Oscillator",
    "Program",
    "Rodas5P",
    "Smooth",
    "Start",
    "energy",
    "final_displacement",
    "is_successful",
    "ready",
    "restoring",
    "simulate",
    "starting_state",
]
