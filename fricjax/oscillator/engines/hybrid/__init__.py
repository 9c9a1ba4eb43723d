"""Half-cycles in phase angle, for laws without internal states."""

from .amplitude_table import Span
from .engine import Hybrid, nodes_for

__all__ = ["Hybrid", "Span", "nodes_for"]
