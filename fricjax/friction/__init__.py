"""Friction laws: one force law per file, all of them modules whose coefficients can be fitted and differentiated."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
