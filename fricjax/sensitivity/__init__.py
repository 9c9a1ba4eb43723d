"""What a run can tell: derivatives of the motion, and the information of a planned run about each coefficient."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
