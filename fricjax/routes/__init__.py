"""Evaluation routes beside the trace fit: pairs of displacements, the triangle map, and the rate of energy loss."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
