from .batch import fit_batch
from .batch_result import BatchFit
from .estimate import Estimate, estimate
from .fit import fit
from .moving_floor import fit_on_moving_floor
from .multistart import Multistart, multistart
from .result import Fit, FitError, load_fit

__all__ = [
    "BatchFit",
    "Estimate",
    "Fit",
    "FitError",
    "Multistart",
    "estimate",
    "fit",
    "fit_batch",
    "fit_on_moving_floor",
    "load_fit",
    "multistart",
]
