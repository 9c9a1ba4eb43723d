"""Ways to integrate one oscillator, with one interface; each is imported where it is chosen."""

from .base import AbstractEngine, AbstractPath, Demands

__all__ = ["AbstractEngine", "AbstractPath", "Demands"]
