from . import restoring
from .energy import Energy, energy
from .engines import Events, Exact, Hybrid, Smooth
from .engines.smooth.rosenbrock import Rodas5P
from .motion import RESULTS, Motion, Start, is_successful
from .oscillator import AbstractRelease, ExponentialRelease, Oscillator
from .program import Program
from .session import cores, one_at_a_time, ready, waiting
from .simulate import final_displacement, simulate, starting_state

__all__ = [
    "RESULTS",
    "AbstractRelease",
    "Energy",
    "Events",
    "Exact",
    "ExponentialRelease",
    "Hybrid",
    "Motion",
    "Oscillator",
    "Program",
    "Rodas5P",
    "Smooth",
    "Start",
    "cores",
    "energy",
    "final_displacement",
    "is_successful",
    "one_at_a_time",
    "ready",
    "restoring",
    "simulate",
    "starting_state",
    "waiting",
]
