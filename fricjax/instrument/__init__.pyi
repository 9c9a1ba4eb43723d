from .interferometer import Interferometer
from .synthetic import synthetic_run, white_acceleration

__all__ = ["Interferometer", "synthetic_run", "white_acceleration"]
