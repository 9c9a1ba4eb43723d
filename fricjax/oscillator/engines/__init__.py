"""Three ways to integrate one oscillator, with one interface."""

from ..drive import Drive
from .base import AbstractEngine, AbstractPath, Seen
from .exact import Exact
from .hybrid import Hybrid
from .hybrid.amplitude_table import Span
from .hybrid.decay import UNTABLED
from .smooth import Smooth
from .smooth.mesh import Mesh

__all__ = ["UNTABLED", "AbstractEngine", "AbstractPath", "Drive", "Exact", "Hybrid", "Mesh", "Seen", "Smooth", "Span"]
