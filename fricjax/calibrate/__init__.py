"""Calibration: the rig's mass, stiffness, damping and load, with the uncertainties they were measured with."""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
