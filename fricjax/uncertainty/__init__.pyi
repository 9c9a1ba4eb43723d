from .fitted import budget
from .inputs import Input
from .monte_carlo import MonteCarlo
from .profiles import Profile, profile
from .propagation import propagate
from .resampling import Bootstrap, bootstrap
from .result import Budget, Expanded

__all__ = [
    "Bootstrap",
    "Budget",
    "Expanded",
    "Input",
    "MonteCarlo",
    "Profile",
    "bootstrap",
    "budget",
    "profile",
    "propagate",
]
