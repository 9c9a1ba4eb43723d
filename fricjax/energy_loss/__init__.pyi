from .agreement import Agreement, Route, compare_routes
from .energy import EnergyLoss, energy_of
from .force_fit import ForceFit, fit_force_map
from .force_map import ForceMap, friction_force_map
from .half_cycles import HalfCycleFriction, half_cycle_friction
from .regression import integral_friction
from .weak import weak_form

__all__ = [
    "Agreement",
    "EnergyLoss",
    "ForceFit",
    "ForceMap",
    "HalfCycleFriction",
    "Route",
    "compare_routes",
    "energy_of",
    "fit_force_map",
    "friction_force_map",
    "half_cycle_friction",
    "integral_friction",
    "weak_form",
]
