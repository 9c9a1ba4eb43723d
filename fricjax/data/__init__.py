"""Displacement over time: traces and records, readers and writers, logged preprocessing, the anatomy of a decay.

This folder knows time series and units, and no physics of friction.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
