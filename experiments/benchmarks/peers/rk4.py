"""Peer: the regularised law by a fourth-order Runge-Kutta loop in numba.

The fit uses SciPy. A reversal takes microseconds, so the loop needs 16 steps per sample to stay below a tenth of the
noise.
"""

import math

import numba
import numpy as np
from record import Record
from rig import LOAD, MASS, NOISE, V_S

from peers.least_squares import Outcome, minimise

SUBSTEPS = 16


@numba.njit(fastmath=True, inline="always")
def acceleration(x, v, spring, viscous, friction):
    return -(spring * x + viscous * v + friction * math.tanh(v * (1 / V_S)))


@numba.njit(fastmath=True)
def displacement(t, substeps, mu, damping, stiffness, x0, offset):
    """Integrate by the classical fourth-order method with equal steps.

    The samples must be evenly spaced.
    """
    spring, viscous, friction = stiffness / MASS, damping / MASS, mu * LOAD / MASS
    h = (t[1] - t[0]) / substeps
    x, v = x0, 0.0
    out = np.empty(t.size)
    for i in range(t.size):
        out[i] = x + offset
        for _ in range(substeps):
            a1 = acceleration(x, v, spring, viscous, friction)
            v2 = v + 0.5 * h * a1
            a2 = acceleration(x + 0.5 * h * v, v2, spring, viscous, friction)
            v3 = v + 0.5 * h * a2
            a3 = acceleration(x + 0.5 * h * v2, v3, spring, viscous, friction)
            v4 = v + h * a3
            a4 = acceleration(x + h * v3, v4, spring, viscous, friction)
            x += h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return out


@numba.njit(fastmath=True)
def residual(t, measured, mu, damping, stiffness, x0, offset):
    return (displacement(t, SUBSTEPS, mu, damping, stiffness, x0, offset) - measured) / NOISE


def simulate(record: Record) -> np.ndarray:
    """Simulate the displacement [m] at the true values."""
    p = record.truth
    return displacement(record.t, SUBSTEPS, *(p[name] for name in record.names))


def fit(record: Record) -> Outcome:
    """Fit mu, damping, stiffness, x0 and offset.

    The finite differences exceed the ripple of the equal steps.
    """
    return minimise(lambda p: residual(record.t, record.x, *p), record, difference=1e-5)
