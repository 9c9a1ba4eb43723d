"""Trials: refits with other models, and the outcome of a fit."""
