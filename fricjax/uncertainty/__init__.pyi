from .fitted import budget
from .hierarchy import Hierarchical, hierarchical
from .inputs import Input
from .monte_carlo import MonteCarlo
from .noise_models import NoiseModelRow, NoiseModels, noise_models
from .profiles import Profile, profile
from .propagation import propagate
from .resampling import Bootstrap, bootstrap
from .result import Budget, Expanded
from .routes import route_budget
from .sampling import Posterior, posterior
from .sandwich import Sandwich, sandwich

__all__ = [
    "Bootstrap",
    "Budget",
    "Expanded",
    "Hierarchical",
    "Input",
    "MonteCarlo",
    "NoiseModelRow",
    "NoiseModels",
    "Posterior",
    "Profile",
    "Sandwich",
    "bootstrap",
    "budget",
    "hierarchical",
    "noise_models",
    "posterior",
    "profile",
    "propagate",
    "route_budget",
    "sandwich",
]
