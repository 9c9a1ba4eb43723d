"""Uncertainty budgets by the GUM, Monte Carlo, bootstrap, profiles and posteriors."""

import lazy_loader as _lazy_loader

from ..errors import suggesting as _suggesting

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
__getattr__ = _suggesting(__name__, __getattr__, __all__)
