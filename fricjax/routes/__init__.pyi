from .agreement import Agreement, Route, compare_routes
from .energy import EnergyLoss, energy_of
from .energy_balance import HalfCycleFriction, half_cycle_friction
from .energy_regression import integral_friction
from .estimates import Estimates
from .final_displacement import fit_final_displacements
from .force_fit import ForceFit, fit_force_map
from .force_map import ForceMap, friction_force_map
from .pairs import Pairs, pairs_of, read_pairs
from .release import fit_release
from .result import RouteFit
from .static import Attempts, Bracket, Probit, attempts, bracket, probit
from .triangle_map import fit_triangle_map
from .weak_form import weak_form

__all__ = [
    "Agreement",
    "Attempts",
    "Bracket",
    "EnergyLoss",
    "Estimates",
    "ForceFit",
    "ForceMap",
    "HalfCycleFriction",
    "Pairs",
    "Probit",
    "Route",
    "RouteFit",
    "attempts",
    "bracket",
    "compare_routes",
    "energy_of",
    "fit_final_displacements",
    "fit_force_map",
    "fit_release",
    "fit_triangle_map",
    "friction_force_map",
    "half_cycle_friction",
    "integral_friction",
    "pairs_of",
    "probit",
    "read_pairs",
    "weak_form",
]
