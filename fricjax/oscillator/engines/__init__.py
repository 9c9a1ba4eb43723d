"""Ways to integrate one oscillator, with one interface."""

from ..oscillator import Drive
from .base import AbstractEngine, AbstractPath, Demands
from .events import Events
from .exact import Exact
from .hybrid import Hybrid
from .hybrid.amplitude_table import Span
from .hybrid.decay import UNTABLED
from .smooth import Smooth
from .smooth.mesh import Mesh

__all__ = [
    "UNTABLED",
    "AbstractEngine",
    "AbstractPath",
    "Demands",
    "Drive",
    "Events",
    "Exact",
    "Hybrid",
    "Mesh",
    "Smooth",
    "Span",
]
