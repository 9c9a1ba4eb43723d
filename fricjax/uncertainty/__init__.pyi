from .fitted import budget
from .inputs import Input
from .monte_carlo import MonteCarlo
from .profiles import Profile, profile
from .propagation import propagate
from .resampling import Bootstrap, bootstrap
from .result import Budget, Expanded
from .sampling import Posterior, posterior

__all__ = [
    "Bootstrap",
    "Budget",
    "Expanded",
    "Input",
    "MonteCarlo",
    "Posterior",
    "Profile",
    "bootstrap",
    "budget",
    "posterior",
    "profile",
    "propagate",
]
