"""Friction laws: one force law per file, all of them modules whose coefficients can be fitted and differentiated."""

from .base import AbstractFriction
from .coulomb import Coulomb
from .lugre import LuGre
from .stribeck import Stribeck
from .sum import Sum
from .tanh import Tanh
from .windage import Windage

__all__ = ["AbstractFriction", "Coulomb", "LuGre", "Stribeck", "Sum", "Tanh", "Windage"]
