"""Route 4: friction from energy loss, and the agreement of all routes."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
