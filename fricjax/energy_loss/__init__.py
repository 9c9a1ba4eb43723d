"""Route 4: friction from the rate of energy loss, by half-cycles and against velocity; and how all routes agree."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
