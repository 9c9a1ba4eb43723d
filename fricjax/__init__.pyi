from . import calibrate, data, fitting, friction, instrument, oscillator, show
from .calibrate import Measured, Rig
from .data import Record, Trace, read, write
from .fitting import BatchFit, Fit, fit, fit_batch, load_fit
from .instrument import synthetic_run
from .oscillator import Motion, Oscillator, energy, final_displacement, restoring, simulate

__version__: str

__all__ = [
    "BatchFit",
    "Fit",
    "Measured",
    "Motion",
    "Oscillator",
    "Record",
    "Rig",
    "Trace",
    "calibrate",
    "data",
    "energy",
    "final_displacement",
    "fit",
    "fit_batch",
    "fitting",
    "friction",
    "instrument",
    "load_fit",
    "oscillator",
    "read",
    "restoring",
    "show",
    "simulate",
    "synthetic_run",
    "write",
]
