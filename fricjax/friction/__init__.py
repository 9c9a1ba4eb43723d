"""Friction laws: one force law per file, all of them modules whose coefficients can be fitted and differentiated."""

from .ageing import Ageing
from .base import AbstractFriction
from .coulomb import Coulomb
from .load_dependent import LoadDependent
from .lorentzian import Lorentzian
from .lugre import LuGre
from .makkar import Makkar
from .spline import MonotoneSpline, Spline
from .stribeck import Stribeck
from .sum import Sum
from .tanh import Tanh
from .viscous import Viscous
from .windage import Windage

__all__ = [
    "AbstractFriction",
    "Ageing",
    "Coulomb",
    "LoadDependent",
    "Lorentzian",
    "LuGre",
    "Makkar",
    "MonotoneSpline",
    "Spline",
    "Stribeck",
    "Sum",
    "Tanh",
    "Viscous",
    "Windage",
]
