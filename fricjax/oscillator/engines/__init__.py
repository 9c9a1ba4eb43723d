"""Three ways to integrate one oscillator, with one interface."""

from .base import AbstractEngine
from .exact import Exact
from .hybrid import Hybrid
from .smooth import Drive, Smooth

__all__ = ["AbstractEngine", "Drive", "Exact", "Hybrid", "Smooth"]
