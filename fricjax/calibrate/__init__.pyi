from .frf import ModalCalibration, calibrate_frf
from .ringdown import calibrate_added_mass, calibrate_ringdown
from .ringdown_calibration import RingdownCalibration

__all__ = ["ModalCalibration", "RingdownCalibration", "calibrate_added_mass", "calibrate_frf", "calibrate_ringdown"]
