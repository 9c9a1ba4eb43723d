from . import restoring
from .energy import Energy, energy
from .engines.events import Events
from .engines.exact import Exact
from .engines.hybrid import Hybrid
from .engines.smooth import Smooth
from .engines.smooth.rosenbrock import Rodas5P
from .motion import Motion, Start
from .observed import observe
from .oscillator import AbstractRelease, ExponentialRelease, Oscillator
from .outcome import RESULTS, is_successful
from .program import Program
from .session import cores, one_at_a_time, one_blas_thread, ready, waiting
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
    "observe",
    "one_at_a_time",
    "one_blas_thread",
    "ready",
    "restoring",
    "simulate",
    "starting_state",
    "waiting",
]
