"""Engines that integrate an oscillator, with a common interface."""

from .base import AbstractEngine, AbstractPath, Demands

__all__ = ["AbstractEngine", "AbstractPath", "Demands"]
