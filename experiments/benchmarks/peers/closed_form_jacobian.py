"""Peer: the closed form with hand-written derivatives, in numba.

The law is Coulomb and viscous friction. One pass over the samples gives the displacement and its derivatives by all
parameters. Finite differences need six passes.
"""

import math

import numba
import numpy as np
from record import Record
from rig import LOAD, MASS, NOISE

from peers.closed_form import residual
from peers.least_squares import Outcome, minimise


@numba.njit(fastmath=True)
def slopes(t, half_cycles, mu, damping, stiffness, x0, offset):
    """Compute derivatives of the displacement, shape (n, 5).

    The columns are mu, damping, stiffness, x0 and offset. The moving border between two half-cycles adds nothing,
    because the velocity vanishes there.
    """
    rate, band = damping / (2 * MASS), mu * LOAD / stiffness
    omega = math.sqrt(stiffness / MASS - rate * rate)
    lag, half = math.atan(rate / omega), math.pi / omega
    decay = math.exp(-rate * half)
    of_rate = np.array([0.0, 1 / (2 * MASS), 0.0, 0.0, 0.0])
    of_band = np.array([LOAD / stiffness, 0.0, -band / stiffness, 0.0, 0.0])
    of_omega = (np.array([0.0, 0.0, 1 / MASS, 0.0, 0.0]) - 2 * rate * of_rate) / (2 * omega)
    of_lag = (omega * of_rate - rate * of_omega) / (omega * omega + rate * rate)
    of_turn = half * of_rate - rate * half / omega * of_omega
    of_offset = np.array([0.0, 0.0, 0.0, 0.0, 1.0])

    strokes = min(half_cycles, int(t[-1] / half) + 1)
    factor, of_centre, of_factor = np.empty(strokes), np.empty((strokes, 5)), np.empty((strokes, 5))
    y, of_y, side = x0, np.array([0.0, 0.0, 0.0, 1.0, 0.0]), math.copysign(1.0, x0)
    sign = 1.0
    for n in range(strokes):
        way, of_way = y - side * band, of_y - side * of_band
        grown = sign * math.exp(rate * half * n) / math.cos(lag)
        factor[n] = way * grown
        of_factor[n] = grown * of_way + factor[n] * (n * of_turn + math.tan(lag) * of_lag)
        of_centre[n] = side * of_band + of_offset
        y, of_y = side * band - decay * way, side * of_band - decay * (of_way - way * of_turn)
        side, sign = -side, -sign
    found = np.empty((t.size, 5))
    for i in range(t.size):
        n = int(t[i] / half)
        if n < strokes:
            size, phase = math.exp(-rate * t[i]), omega * t[i] - lag
            cosine, sine = size * math.cos(phase), factor[n] * size * math.sin(phase)
            for k in range(5):
                moved = (of_factor[n, k] - factor[n] * of_rate[k] * t[i]) * cosine
                found[i, k] = of_centre[n, k] + moved - sine * (of_omega[k] * t[i] - of_lag[k])
        else:
            for k in range(5):
                found[i, k] = of_y[k] + of_offset[k]
    return found


def fit(record: Record) -> Outcome:
    """Fit mu, damping, stiffness, x0 and offset by these derivatives."""
    return minimise(
        lambda p: residual(record.t, record.x, record.half_cycles, *p),
        record,
        difference=0.0,
        jacobian=lambda p: slopes(record.t, record.half_cycles, *p) / NOISE,
    )
