"""Half-cycles in phase angle, for laws without internal states."""

from .amplitude_table import Span
from .engine import Hybrid

__all__ = ["Hybrid", "Span"]
