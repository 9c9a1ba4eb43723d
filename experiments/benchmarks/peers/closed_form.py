"""Peer: Coulomb and viscous friction in closed form, in numba.

The fit uses SciPy's Levenberg-Marquardt. The number of half-cycles to the rest is an input. Without it the fit sticks
in local minima.
"""

import math

import numba
import numpy as np
from record import Record
from rig import LOAD, MASS, NOISE

from peers.least_squares import Outcome, minimise


@numba.njit(fastmath=True)
def displacement(t, half_cycles, mu, damping, stiffness, x0, offset):
    """Compute half-cycles of equal duration from the time.

    Each sample takes one cosine and one exponential.
    """
    rate, band = damping / (2 * MASS), mu * LOAD / stiffness
    omega = math.sqrt(stiffness / MASS - rate * rate)
    lag, half = math.atan(rate / omega), math.pi / omega
    strokes = min(half_cycles, int(t[-1] / half) + 1)
    centre, factor = np.empty(strokes), np.empty(strokes)
    y, side, sign = x0, math.copysign(1.0, x0), 1.0
    for n in range(strokes):
        centre[n] = side * band + offset
        # Cosine and exponential continue from the release across half-cycles: undo both.
        factor[n] = sign * (y - side * band) / math.cos(lag) * math.exp(rate * half * n)
        y = side * band - math.exp(-rate * half) * (y - side * band)
        side, sign = -side, -sign
    x = np.empty(t.size)
    for i in range(t.size):
        n = int(t[i] / half)
        if n < strokes:
            x[i] = centre[n] + factor[n] * math.exp(-rate * t[i]) * math.cos(omega * t[i] - lag)
        else:
            x[i] = y + offset
    return x


@numba.njit(fastmath=True)
def residual(t, measured, half_cycles, mu, damping, stiffness, x0, offset):
    x = displacement(t, half_cycles, mu, damping, stiffness, x0, offset)
    return (x - measured) / NOISE


def simulate(record: Record) -> np.ndarray:
    """Simulate the displacement [m] at the true values."""
    p = record.truth
    return displacement(record.t, record.half_cycles, *(p[name] for name in record.names))


def fit(record: Record) -> Outcome:
    """Fit mu, damping, stiffness, x0 and offset by small differences.

    The model is smooth to rounding.
    """
    return minimise(lambda p: residual(record.t, record.x, record.half_cycles, *p), record, difference=1e-7)
