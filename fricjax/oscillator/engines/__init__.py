"""Three ways to integrate one oscillator, with one interface."""

from .amplitudes import Span
from .base import AbstractEngine
from .course import UNTABLED
from .exact import Exact
from .hybrid import Hybrid
from .path import AbstractPath
from .smooth import Drive, Smooth

__all__ = ["UNTABLED", "AbstractEngine", "AbstractPath", "Drive", "Exact", "Hybrid", "Smooth", "Span"]
