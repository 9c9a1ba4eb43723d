"""Adaptive and mesh-based integration for laws without a jump."""

from .engine import Smooth
from .mesh import Mesh

__all__ = ["Mesh", "Smooth"]
