from . import corrections
from .measured import Measured
from .rig import Rig

__all__ = ["Measured", "Rig", "corrections"]
