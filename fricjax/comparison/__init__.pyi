from .compare import compare
from .result import Comparison

__all__ = ["Comparison", "compare"]
