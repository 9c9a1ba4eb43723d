from .fits import COEFFICIENTS, ITERATIONS, RUN_COEFFICIENTS, PlainFits, decay_slopes, fit_plain

__all__ = ["COEFFICIENTS", "ITERATIONS", "RUN_COEFFICIENTS", "PlainFits", "decay_slopes", "fit_plain"]
