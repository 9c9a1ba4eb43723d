"""Least squares with bounds, linear parameters and robust losses: it knows neither records nor oscillators."""
