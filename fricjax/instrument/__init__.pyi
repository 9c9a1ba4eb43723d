from .air import refractive_index
from .impact import ImpactTest, impact_test
from .interferometer import Interferometer
from .synthetic import synthetic_run, white_acceleration

__all__ = ["ImpactTest", "Interferometer", "impact_test", "refractive_index", "synthetic_run", "white_acceleration"]
