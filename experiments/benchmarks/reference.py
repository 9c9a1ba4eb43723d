"""Reference solutions that use no engine of fricjax.

Coulomb has a closed form. The other laws use SciPy at tight tolerance. For archives of a thousand runs a Runge-Kutta
loop in numba replaces DOP853. With 48 steps per sample the two agree to two picometres.
"""

import math
from collections.abc import Mapping

import numpy as np
from peers import rk4
from rig import LOAD, MASS, SIGMA1, V_S
from scipy.integrate import solve_ivp

Parameters = Mapping[str, float]


def displacement(law: str, t: np.ndarray, p: Parameters, half_cycles: int) -> np.ndarray:
    """Compute the reading of the instrument [m], shape (n,).

    `half_cycles` is the number to the rest under Coulomb friction.
    """
    if law == "coulomb":
        return p["offset"] + coulomb(t, p, half_cycles)
    if law == "tanh":
        return rk4.displacement(t, 48, p["mu"], p["damping"], p["stiffness"], p["x0"], p["offset"])
    return p["offset"] + lugre(t, p)


def half_cycles(p: Parameters, duration: float) -> int:
    """Count half-cycles to the rest within a duration [s], under Coulomb friction.

    A million means that the mass still moves at the end.
    """
    rate, omega = _decay(p)
    band, y, n = p["mu"] * LOAD / p["stiffness"], abs(p["x0"]), 0
    while y > band:
        y, n = abs(band - math.exp(-rate * math.pi / omega) * (y - band)), n + 1
    return n if n * math.pi / omega < duration else 10**6


def coulomb(t: np.ndarray, p: Parameters, half_cycles: int) -> np.ndarray:
    """Compute damped cosines about the shifted centre, one per half-cycle."""
    rate, omega = _decay(p)
    half, y, begin = math.pi / omega, p["x0"], 0.0
    x, stroke = np.empty_like(t), 0
    while begin <= t[-1] and stroke < half_cycles:
        centre = math.copysign(p["mu"] * LOAD / p["stiffness"], y)
        inside = (t >= begin) & (t < begin + half)
        tau = t[inside] - begin
        wave = np.cos(omega * tau) + rate / omega * np.sin(omega * tau)
        x[inside] = centre + (y - centre) * np.exp(-rate * tau) * wave
        y, stroke = centre - math.exp(-rate * half) * (y - centre), stroke + 1
        begin = stroke * half
    x[t >= begin] = y
    return x


def _decay(p: Parameters) -> tuple[float, float]:
    """Return decay rate [1/s] and damped angular frequency [rad/s]."""
    rate = p["damping"] / (2 * MASS)
    return rate, math.sqrt(p["stiffness"] / MASS - rate**2)


def tanh(t: np.ndarray, p: Parameters) -> np.ndarray:
    """Integrate the regularised law by DOP853."""
    force = p["mu"] * LOAD

    def rates(_t: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], -(p["stiffness"] * y[0] + p["damping"] * y[1] + force * math.tanh(y[1] / V_S)) / MASS

    return solve_ivp(rates, (0.0, t[-1]), (p["x0"], 0.0), method="DOP853", t_eval=t, rtol=1e-12, atol=1e-15).y[0]


def lugre(t: np.ndarray, p: Parameters) -> np.ndarray:
    """Integrate LuGre after a slow pull by LSODA, with scaled states."""
    force, sigma0, sigma1 = p["mu"] * LOAD, p["sigma0"], SIGMA1
    length, speed, bristle = p["x0"], abs(p["x0"]) * math.sqrt(p["stiffness"] / MASS), force / sigma0

    def rates(_t: float, y: np.ndarray) -> tuple[float, float, float]:
        v = speed * y[1]
        creep = v - sigma0 * abs(v) * bristle * y[2] / force
        pull = p["stiffness"] * length * y[0] + p["damping"] * v + force * y[2] + sigma1 * creep
        return v / length, -pull / MASS / speed, creep / bristle

    start = (1.0, 0.0, math.copysign(1.0, length))
    found = solve_ivp(rates, (0.0, t[-1]), start, method="LSODA", t_eval=t, rtol=1e-13, atol=1e-13)
    return length * found.y[0]
