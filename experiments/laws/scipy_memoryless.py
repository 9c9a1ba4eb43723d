"""Laws without internal states for SciPy, in plain Python numbers.

They follow the published formulas. Each gives the force [N] at a speed, and the force that holds the mass at rest.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import exp, log1p, tanh
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from experiments.laws.scipy_motion import Law


def memoryless(sliding: Callable[[float], float], static: float = 0.0) -> Law:
    """Build a law without internal states.

    `sliding` is the force [N] at a speed of zero or more [m/s]. `static` is the force that holds the mass at rest [N].
    """

    def act(v: float, _z: Sequence[float], d: float) -> tuple[float]:
        # A trial step may end beyond the reversal.
        return (d * sliding(max(d * v, 0.0)),)

    return Law(act, static=static)


def constant(kinetic: float, static: float | None = None, viscous: float = 0.0, drag: float = 0.0) -> Law:
    """Build Coulomb friction with optional viscous and quadratic drag."""
    return memoryless(lambda u: kinetic + (viscous + drag * u) * u, kinetic if static is None else static)


def stribeck(kinetic: float, static: float, v_s: float, viscous: float = 0.0, drag: float = 0.0) -> Law:
    more = static - kinetic
    return memoryless(lambda u: kinetic + more * exp(-((u / v_s) ** 2)) + (viscous + drag * u) * u, static)


def lorentzian(kinetic: float, static: float, v_s: float) -> Law:
    return memoryless(lambda u: kinetic + (static - kinetic) / (1 + (u / v_s) ** 2), static)


def tanh_law(kinetic: float, v_s: float) -> Law:
    return memoryless(lambda u: kinetic * tanh(u / v_s))


def makkar(load: float, g1: float, g2: float, g3: float, g4: float, g5: float, g6: float) -> Law:
    """Build the law of Makkar et al. (2005).

    g1 and g4 are per load.
    """
    return memoryless(lambda u: load * (g1 * (tanh(g2 * u) - tanh(g3 * u)) + g4 * tanh(g5 * u)) + g6 * u)


def smoothest(knots: Sequence[float], forces: Sequence[float]) -> CubicSpline:
    """Build a spline with continuous curvature in ln(1 + v/knots_1).

    It is straight at the first speed and level at the last.
    """
    stretched = np.log1p(np.asarray(knots) / knots[1])
    ends: Any = ((2, 0.0), (1, 0.0))
    return CubicSpline(stretched, forces, bc_type=ends)


def monotone(knots: Sequence[float], forces: Sequence[float]) -> CubicHermiteSpline:
    """Build a monotone spline from the smoothest one.

    Slopes are limited to between 0 and 3 times the smaller slope of the neighbouring lines (Hyman).
    """
    curve = smoothest(knots, forces)
    slopes, lines = curve.derivative()(curve.x), np.diff(forces) / np.diff(curve.x)
    near = np.array([lines[[max(i - 1, 0), min(i, lines.size - 1)]] for i in range(slopes.size)])
    sign = np.sign(near[:, 0])
    steepest = np.where(sign == np.sign(near[:, 1]), 3 * np.min(np.abs(near), axis=1), 0.0)
    return CubicHermiteSpline(curve.x, forces, sign * np.clip(sign * slopes, 0.0, steepest))


def spline(load: float, curve: CubicSpline | CubicHermiteSpline, unit: float) -> Law:
    """Build a law from a cubic spline in ln(1 + v/unit).

    It is constant beyond the last knot. Coefficients are plain numbers, for speed.
    """
    knots, pieces, last = curve.x.tolist(), curve.c.T.tolist(), float(curve(curve.x[-1]))

    def sliding(u: float) -> float:
        at = log1p(u / unit)
        i = bisect_right(knots, at) - 1
        if i >= len(pieces):
            return load * last
        c3, c2, c1, c0 = pieces[i]
        s = at - knots[i]
        return load * (c0 + s * (c1 + s * (c2 + s * c3)))

    return memoryless(sliding, load * float(curve(0.0)))
