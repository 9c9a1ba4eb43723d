from .fitted import budget
from .inputs import Input
from .monte_carlo import MonteCarlo
from .propagation import propagate
from .result import Budget, Expanded

__all__ = ["Budget", "Expanded", "Input", "MonteCarlo", "budget", "propagate"]
