"""Friction coefficients from a measured free decay of a spring-mass oscillator.

A mass is pulled aside and released, and a displacement interferometer records its motion until friction stops it. From
such a record fricjax estimates the friction coefficient and the viscous damping, with uncertainties. The package is
lazy: a name is imported at its first use, so `import fricjax` takes milliseconds. `__init__.pyi` lists the names.
"""

import lazy_loader as _lazy_loader

from .errors import suggesting as _suggesting

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
__getattr__ = _suggesting(__name__, __getattr__, __all__)
