"""Laws without internal states."""

from fricjax.friction import (
    Ageing,
    Coulomb,
    LoadDependent,
    Lorentzian,
    Makkar,
    MonotoneSpline,
    QuadraticDrag,
    Spline,
    Stribeck,
    Tanh,
    Viscous,
)
from tests.cases.case import LawCase

_KNOTS = (0.0, 1e-3, 1e-2, 0.2)
_FORCES = (0.15, 0.14, 0.1, 0.12)

MEMORYLESS = {
    "Ageing": LawCase(Ageing(0.1, 0.01, 60.0, 0.15), 0.3, 0.2),
    "Coulomb": LawCase(Coulomb(0.1), 0.2, 0.2),
    "Coulomb static": LawCase(Coulomb(0.1, 0.15), 0.3, 0.2),
    "LoadDependent": LawCase(LoadDependent(0.1, 2 / 3, 16.0, 0.05), 0.45, 0.45),
    "Lorentzian": LawCase(Lorentzian(0.1, 0.15, 5e-3), 0.3, 0.2),
    "Makkar": LawCase(Makkar(0.05, 2e3, 1e2, 0.1, 1e3, 0.5), 0.0, 0.2),
    "MonotoneSpline": LawCase(MonotoneSpline(_KNOTS, _FORCES), 0.3, 0.2),
    "Spline": LawCase(Spline(_KNOTS, _FORCES), 0.3, 0.2),
    "Stribeck": LawCase(Stribeck(0.1, 0.15, 5e-3), 0.3, 0.2),
    "Stribeck exponential": LawCase(Stribeck(0.1, 0.15, 5e-3, 1.0), 0.3, 0.2),
    "Tanh": LawCase(Tanh(0.1, 1e-3), 0.0, 0.2),
    "Viscous": LawCase(Viscous(0.5), 0.0, 0.0),
    "QuadraticDrag": LawCase(QuadraticDrag(0.5), 0.0, 0.0),
    "Sum": LawCase(Stribeck(0.1, 0.15, 5e-3) + QuadraticDrag(0.5), 0.3, 0.2),
}
