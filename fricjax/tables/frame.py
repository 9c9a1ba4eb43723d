"""Reference motion of the half-cycles, and the positions of points in phase.

Points are even in the rank

    share ln(1 + theta/layer)/ln(1 + half/layer) + (1 - share) theta/half

of the phase since the last, or until the next, reversal, so they are dense where friction changes fast.
"""

from typing import NamedTuple

import numpy as np

from ..oscillator import Oscillator
from ..oscillator.restoring import Pendulum
from .forces import Forces
from .lookup import read

# Part of the points spread evenly over the logarithm of the distance from the layer, in a mesh and in the mesh that
# checks it. The rest is even in phase. Chosen, not derived; `experiments/tables/run.py` shows the resulting errors.
SHARES = (0.6, 0.45)
# Newton steps to the phase of a rank; from the logarithmic part alone as the start, ten reach rounding error.
_NEWTON_STEPS = 12
# The thinnest layer of a mesh [rad]; faster changes do not alter the motion by more than rounding error.
THINNEST = 1e-9
# A layer much wider than a half-cycle, for forces without one; the points are then even in phase.
WIDEST = 1e3


class Frame(NamedTuple):
    """Reference motion of the half-cycles.

    Arrays have the shape (half_cycles,). `growth` is the change of the amplitude in a half-cycle, `middle` the phase of
    the edge in the middle.
    """

    chart: bool
    side: np.ndarray
    omega: np.ndarray
    centre: np.ndarray
    amplitude: np.ndarray
    growth: np.ndarray
    layer: np.ndarray
    middle: np.ndarray


def make_frame(
    oscillator: Oscillator, forces: Forces, points: np.ndarray, centre: str = "onset", grading: float = 1.0
) -> Frame:
    """Return the reference motion between approximate turning points [m].

    The reference stiffness is the secant at the start, in the coordinate of the spring.
    """
    restoring = oscillator.restoring
    chart = isinstance(restoring, Pendulum)
    q, slope = (2 * np.sin(points / 2), np.cos(points[:-1] / 2)) if chart else (points, np.ones(points.size - 1))
    side = np.where(points[:-1] < 0, -1.0, 1.0)
    omega = np.sqrt(np.abs(read(forces.restoring, side, points[:-1])) / np.abs(q[:-1] * slope))
    friction = np.full(side.size, forces.onset)
    if centre == "fastest":
        swing = np.abs(np.diff(q)) / 2
        friction = read(forces.resisting, side, omega * swing)
    dead_band = friction / omega**2
    amplitude = side * q[:-1] - dead_band
    growth = dead_band - side * q[1:] - amplitude
    largest = np.maximum(amplitude, amplitude + growth)
    layer = grading * forces.velocity_scale / (omega * np.maximum(largest, np.finfo(float).tiny))
    if chart:
        # The lapse of time has poles where the slope of the coordinate vanishes, arctanh(slope) from the reversals.
        layer = np.minimum(layer, np.arctanh(np.clip(slope, 1e-6, 1 - 1e-6)))
    middle = np.full(side.size, np.pi / 2)
    return Frame(chart, side, omega, dead_band, amplitude, growth, np.clip(layer, THINNEST, WIDEST), middle)


def rank_of(frame: Frame, phase: np.ndarray, late: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rank of a phase and its slope.

    Arrays have the half-cycles along the first axis.
    """
    axes = (slice(None), *(None,) * (phase.ndim - 1))
    layer, middle = frame.layer[axes], frame.middle[axes]
    half = np.where(late, np.pi - middle, middle)
    span = np.log1p(half / layer)
    rank = share * np.log1p(phase / layer) / span + (1 - share) * phase / half
    return rank, share / (span * (layer + phase)) + (1 - share) / half


def phase_of(frame: Frame, rank: np.ndarray, late: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the phase at a rank by Newton's method, and its slope.

    The rank is concave in the phase and at most its logarithmic part, so the steps rise to the solution.
    """
    axes = (slice(None), *(None,) * (rank.ndim - 1))
    layer, middle = frame.layer[axes], frame.middle[axes]
    phase = layer * np.expm1(rank * np.log1p(np.where(late, np.pi - middle, middle) / layer))
    for _ in range(_NEWTON_STEPS):
        value, rise = rank_of(frame, phase, late, share)
        phase = phase + (rank - value) / rise
    return np.where(rank > 0, phase, 0.0), 1 / rank_of(frame, phase, late, share)[1]
