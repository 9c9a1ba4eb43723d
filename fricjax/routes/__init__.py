"""Evaluation routes beside the trace fit: pairs of displacements, the triangle map, and the rate of energy loss."""

from .final_displacement import fit_final_displacements
from .pairs import Pairs, pairs_of, read_pairs
from .result import RouteFit
from .static import Attempts, Bracket, Probit, attempts, bracket, probit
from .triangle_map import fit_triangle_map

__all__ = [
    "Attempts",
    "Bracket",
    "Pairs",
    "Probit",
    "RouteFit",
    "attempts",
    "bracket",
    "fit_final_displacements",
    "fit_triangle_map",
    "pairs_of",
    "probit",
    "read_pairs",
]
