"""Fitting oscillators to records."""

from .fit import fit
from .result import Fit, FitError
from .store import load_fit

__all__ = ["Fit", "FitError", "fit", "load_fit"]
