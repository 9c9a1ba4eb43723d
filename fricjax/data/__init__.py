"""Traces and records of displacement over time, with readers, writers and preprocessing.

This folder handles time series and units. It contains no physics of friction.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
