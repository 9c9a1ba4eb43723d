"""Peer: SciPy's DOP853 from reversal to reversal.

Each reversal is an event of solve_ivp. The rest condition is checked there.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from rig import DAMPING, MASS, STIFFNESS, X0
from scipy.integrate import solve_ivp

# The loosest tolerances that reach 1e-10 m; errors.py measures them.
RTOL = {"map": 2e-8, "sliding": 3e-8}


class Slider(NamedTuple):
    """A machine with set-valued friction.

    Attributes:
        sliding: friction force [N] at a speed [m/s].
        static: largest friction force at rest [N].
    """

    mass: float
    stiffness: float
    damping: float
    sliding: Callable[[float], float]
    static: float


PAPER = Slider(1.0, 5000.0, 0.0, lambda speed: 0.981, 0.981)
SLIDING = Slider(
    MASS, STIFFNESS, DAMPING, lambda speed: 9.66 * (0.05 + 0.015 * math.exp(-((speed / 5e-3) ** 2))), 9.66 * 0.065
)


def displacement(machine: Slider, x0: float, ts: np.ndarray, rtol: float) -> np.ndarray:
    """Compute the displacement [m] after a release from `x0`, shape (n,)."""
    x, begin, y = np.full(ts.shape, x0), 0.0, x0
    while machine.stiffness * abs(y) > machine.static and begin <= ts[-1]:
        stroke = _stroke(machine, y, rtol, dense=True)
        inside = (ts >= begin) & (ts < begin + stroke.t[-1])
        x[inside] = stroke.sol(ts[inside] - begin)[0] if inside.any() else ()
        begin, y = begin + stroke.t[-1], stroke.y[0, -1]
        x[ts >= begin] = y
    return x


def final_displacement(machine: Slider, x0: float, rtol: float) -> float:
    """Compute the rest position [m]."""
    y = x0
    while machine.stiffness * abs(y) > machine.static:
        y = _stroke(machine, y, rtol, dense=False).y[0, -1]
    return y


def final_displacements(x0: np.ndarray) -> np.ndarray:
    """Compute the triangle wave of the `map` workload [m]."""
    return np.array([final_displacement(PAPER, x, RTOL["map"]) for x in x0.tolist()])


def sliding(ts: np.ndarray) -> np.ndarray:
    """Compute the displacement [m] of the `sliding` workload."""
    return displacement(SLIDING, X0, ts, RTOL["sliding"])


def _stroke(machine: Slider, y: float, rtol: float, *, dense: bool):
    """Integrate from rest at `y` to the next reversal."""
    m, k, c, side = machine.mass, machine.stiffness, machine.damping, -math.copysign(1.0, y)
    sliding = machine.sliding

    def rates(_t: float, state: np.ndarray) -> tuple[float, float]:
        x, v = state.tolist()
        return v, -(k * x + c * v + side * sliding(max(side * v, 0.0))) / m

    def reversal(_t: float, state: np.ndarray) -> float:
        return state[1]

    reversal.terminal, reversal.direction = True, -side  # pyright: ignore[reportFunctionMemberAccess]
    return solve_ivp(
        rates, (0.0, 1.0), (y, 0.0), "DOP853", rtol=rtol, atol=rtol * 1e-3 * abs(y), events=reversal, dense_output=dense
    )
