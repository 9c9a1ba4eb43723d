from .driven import DrivenMotion, driven_motion
from .floor import white_acceleration
from .interferometer import Interferometer
from .synthetic import synthetic_run

__all__ = ["DrivenMotion", "Interferometer", "driven_motion", "synthetic_run", "white_acceleration"]
