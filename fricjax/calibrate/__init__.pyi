from .frf import ModalCalibration, calibrate_frf
from .interferometer import InterferometerCalibration, calibrate_interferometer
from .ringdown import calibrate_added_mass, calibrate_ringdown
from .ringdown_calibration import RingdownCalibration

__all__ = [
    "InterferometerCalibration",
    "ModalCalibration",
    "RingdownCalibration",
    "calibrate_added_mass",
    "calibrate_frf",
    "calibrate_interferometer",
    "calibrate_ringdown",
]
