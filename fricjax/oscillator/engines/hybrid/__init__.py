"""Half-cycles in phase angle, for laws without internal states."""

from .amplitude_table import Span
from .decay import UNTABLED
from .engine import Hybrid

__all__ = ["UNTABLED", "Hybrid", "Span"]
