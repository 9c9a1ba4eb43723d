"""Three ways to integrate one oscillator, with one interface."""

from .amplitudes import Span
from .base import AbstractEngine, Seen
from .course import UNTABLED
from .exact import Exact
from .hybrid import Hybrid
from .mesh import Mesh
from .path import AbstractPath
from .smooth import Drive, Smooth

__all__ = ["UNTABLED", "AbstractEngine", "AbstractPath", "Drive", "Exact", "Hybrid", "Mesh", "Seen", "Smooth", "Span"]
