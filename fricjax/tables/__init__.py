"""Free decays from tables of forces.

One set of array expressions integrates every machine without internal states. Forces are data, so all laws share a
compiled program.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
