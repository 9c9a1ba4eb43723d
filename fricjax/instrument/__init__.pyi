from .air import refractive_index
from .interferometer import Interferometer
from .synthetic import synthetic_run, white_acceleration

__all__ = ["Interferometer", "refractive_index", "synthetic_run", "white_acceleration"]
