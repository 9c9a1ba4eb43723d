"""Laws without internal states."""

from fricjax.friction import Coulomb, Stribeck, Tanh, Windage
from tests.cases.case import LawCase

MEMORYLESS = {
    "Coulomb": LawCase(Coulomb(0.1), 0.2, 0.2),
    "Coulomb static": LawCase(Coulomb(0.1, 0.15), 0.3, 0.2),
    "Stribeck": LawCase(Stribeck(0.1, 0.15, 5e-3), 0.3, 0.2),
    "Stribeck exponential": LawCase(Stribeck(0.1, 0.15, 5e-3, 1.0), 0.3, 0.2),
    "Tanh": LawCase(Tanh(0.1, 1e-3), 0.0, 0.2),
    "Windage": LawCase(Windage(0.5), 0.0, 0.0),
    "Sum": LawCase(Stribeck(0.1, 0.15, 5e-3) + Windage(0.5), 0.3, 0.2),
}
