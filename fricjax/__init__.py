"""Friction coefficients from a measured free decay of a spring-mass oscillator.

A mass is pulled aside, released and watched by a displacement interferometer until friction has stopped it. From such
a record fricjax finds the friction coefficient and the viscous damping, with uncertainties. The root is lazy: a name
is imported when it is first asked for, so `import fricjax` costs milliseconds. `__init__.pyi` lists the names.
"""

import lazy_loader as _lazy_loader

from .errors import suggesting as _suggesting

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
__getattr__ = _suggesting(__name__, __getattr__, __all__)
