"""Least squares with bounds, linear parameters and robust losses, independent of oscillators."""
