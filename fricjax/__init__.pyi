from . import (
    archive,
    calibrate,
    comparison,
    data,
    energy_loss,
    errors,
    fitting,
    friction,
    instrument,
    oscillator,
    pairs,
    report,
    rig,
    sensitivity,
    show,
    uncertainty,
)
from .archive import Archive, batch, open_archive
from .calibrate.frf import calibrate_frf
from .calibrate.interferometer import calibrate_interferometer
from .calibrate.ringdown import calibrate_added_mass, calibrate_ringdown
from .comparison import Comparison, compare
from .data import Observation, Record, Trace, read, write
from .energy_loss.agreement import compare_routes
from .energy_loss.force_fit import fit_force_map
from .energy_loss.force_map import friction_force_map
from .energy_loss.half_cycles import half_cycle_friction
from .fitting import (
    BatchFit,
    Estimate,
    Fit,
    Multistart,
    estimate,
    fit,
    fit_batch,
    fit_on_moving_floor,
    load_fit,
    multistart,
)
from .instrument import synthetic_run
from .oscillator import Motion, Oscillator, energy, final_displacement, observe, restoring, simulate
from .pairs.displacements import pairs_of
from .pairs.final_displacement import fit_final_displacements
from .pairs.release import fit_release
from .pairs.triangle_map import fit_triangle_map
from .rig import Measured, Rig
from .show.working import progress

__version__: str

__all__ = [
    "Archive",
    "BatchFit",
    "Comparison",
    "Estimate",
    "Fit",
    "Measured",
    "Motion",
    "Multistart",
    "Observation",
    "Oscillator",
    "Record",
    "Rig",
    "Trace",
    "archive",
    "batch",
    "calibrate",
    "calibrate_added_mass",
    "calibrate_frf",
    "calibrate_interferometer",
    "calibrate_ringdown",
    "compare",
    "compare_routes",
    "comparison",
    "data",
    "energy",
    "energy_loss",
    "errors",
    "estimate",
    "final_displacement",
    "fit",
    "fit_batch",
    "fit_final_displacements",
    "fit_force_map",
    "fit_on_moving_floor",
    "fit_release",
    "fit_triangle_map",
    "fitting",
    "friction",
    "friction_force_map",
    "half_cycle_friction",
    "instrument",
    "load_fit",
    "multistart",
    "observe",
    "open_archive",
    "oscillator",
    "pairs",
    "pairs_of",
    "progress",
    "read",
    "report",
    "restoring",
    "rig",
    "sensitivity",
    "show",
    "simulate",
    "synthetic_run",
    "uncertainty",
    "write",
]
