from .fits import COEFFICIENTS, ITERATIONS, RUN_COEFFICIENTS, PlainFits, fit_plain

__all__ = ["COEFFICIENTS", "ITERATIONS", "RUN_COEFFICIENTS", "PlainFits", "fit_plain"]
