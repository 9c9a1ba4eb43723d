from .displacements import Pairs, pairs_of, read_pairs
from .final_displacement import fit_final_displacements
from .release import fit_release
from .result import Estimates, RouteFit
from .static import Attempts, Bracket, Probit, attempts, bracket, probit
from .triangle_map import fit_triangle_map

__all__ = [
    "Attempts",
    "Bracket",
    "Estimates",
    "Pairs",
    "Probit",
    "RouteFit",
    "attempts",
    "bracket",
    "fit_final_displacements",
    "fit_release",
    "fit_triangle_map",
    "pairs_of",
    "probit",
    "read_pairs",
]
