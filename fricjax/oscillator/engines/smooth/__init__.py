"""Integration in time, and on a mesh over the phase of the half-cycles, for laws without a jump."""

from .engine import Smooth
from .mesh import Mesh

__all__ = ["Mesh", "Smooth"]
