"""Peer: SciPy's odeint (LSODA) with numba functions, and least_squares.

numba compiles the right-hand side and its Jacobian. Every state has its own scale. The steps of the finite differences
are larger than the error of the integrator.
"""

import math
from typing import Any

import numba
import numpy as np
from record import Record
from rig import LOAD, MASS, NOISE, SIGMA1, V_S
from scipy.integrate import odeint

from peers.least_squares import Outcome, minimise

TOLERANCE = {"tanh": 1e-11, "lugre": 1e-12}
DIFFERENCE = 1e-4


@numba.njit(fastmath=True)
def tanh_rates(_t, y, spring, viscous, pull, sharpness):
    return np.array((y[1], -spring * y[0] - viscous * y[1] - pull * math.tanh(sharpness * y[1])))


@numba.njit(fastmath=True)
def tanh_slopes(_t, y, spring, viscous, pull, sharpness):
    steep = pull * sharpness * (1 - math.tanh(sharpness * y[1]) ** 2)
    return np.array(((0.0, 1.0), (-spring, -viscous - steep)))


@numba.njit(fastmath=True)
def lugre_rates(_t, y, spring, viscous, pull, bristle, ratio):
    creep = y[1] - abs(y[1]) * y[2]
    return np.array((y[1], -spring * y[0] - viscous * y[1] - pull * y[2] - bristle * creep, ratio * creep))


@numba.njit(fastmath=True)
def lugre_slopes(_t, y, spring, viscous, pull, bristle, ratio):
    by_v, by_z = 1 - math.copysign(1.0, y[1]) * y[2], -abs(y[1])
    second = (-spring, -viscous - bristle * by_v, -pull - bristle * by_z)
    return np.array(((0.0, 1.0, 0.0), second, (0.0, ratio * by_v, ratio * by_z)))


def displacement(law: str, t: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """Compute the displacement [m] without offset, shape (n,).

    The states are x/x0, v/x0 and z/(F_c/sigma0).
    """
    force, x0 = p["mu"] * LOAD, p["x0"]
    common = (p["stiffness"] / MASS, p["damping"] / MASS, force / MASS / x0)
    system: tuple[Any, ...]
    if law == "lugre":
        system = lugre_rates, lugre_slopes, (1.0, 0.0, 1.0), (*common, SIGMA1 / MASS, x0 * p["sigma0"] / force)
    else:
        system = tanh_rates, tanh_slopes, (1.0, 0.0), (*common, x0 / V_S)
    rates, slopes, start, args = system
    rtol = TOLERANCE[law]
    atol = rtol * np.array([1.0, math.sqrt(common[0]), 1.0])[: len(start)]
    options = {"tfirst": True, "rtol": rtol, "atol": atol, "mxstep": 10**6}
    return x0 * odeint(rates, start, t, args, Dfun=slopes, **options)[:, 0]


def simulate(record: Record) -> np.ndarray:
    """Simulate the displacement [m] at the true values."""
    return displacement(record.law, record.t, record.truth)


def fit(record: Record) -> Outcome:
    """Fit the free parameters by finite differences."""

    def residual(values: np.ndarray) -> np.ndarray:
        p = record.start | dict(zip(record.names, values, strict=True))
        return (displacement(record.law, record.t, p) + p["offset"] - record.x) / NOISE

    return minimise(residual, record, difference=DIFFERENCE)
