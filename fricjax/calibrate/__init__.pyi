from .added_mass import calibrate_added_mass
from .frf import calibrate_frf
from .ringdown import calibrate_ringdown

__all__ = ["calibrate_added_mass", "calibrate_frf", "calibrate_ringdown"]
