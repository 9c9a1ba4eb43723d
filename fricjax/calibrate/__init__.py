"""Calibration: the rig's mass, stiffness, damping and load, with the uncertainties they were measured with."""

from . import corrections
from .measured import Measured
from .rig import Rig

__all__ = ["Measured", "Rig", "corrections"]
