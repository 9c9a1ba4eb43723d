"""Half-cycles of a decay with their points in phase.

Each half-cycle is divided into panels with Chebyshev points. Edges of panels lie at the phases at which the force has a
kink. All numbers of a mesh stay fixed in a fit.
"""

import functools
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ..oscillator import Oscillator
from .forces import Forces, Values
from .frame import SHARES, Frame, make_frame, phase_of, rank_of
from .layout import Layout, choose_layout, quadrature

# Samples of the first approximation of a motion. The phase of a kink is off by (pi/256)^2/8 = 2e-5 by interpolation,
# far less than by rough turning points.
_SKETCH = 257


class Mesh(NamedTuple):
    """Half-cycles, their points and a first approximation of their amplitudes.

    Arrays have the shape (half_cycles,) or (half_cycles, points), including padding.

    Attributes:
        real: True for half-cycles, False for padding.
        side: sign of the turning point at the start [1].
        omega: reference angular frequency [rad/s].
        centre: reference dead band, in the coordinate [m].
        chart: one if the coordinate is that of a pendulum, ``2 sin(x/2)``, else zero; shape ().
        sine, cosine: of the phase at the points [1].
        branch: side of a kink of the spring at the equilibrium on which a point lies, 1 or -1; zero without a kink.
        weight: phase per rank at the points, times the width of the panel [rad].
        integral: matrix from rates at the points to their integrals from the start, shape (points, points).
        nodes: indices of the points that a sample interpolates, without repetitions, shape (nodes,).
        amplitudes: approximation of the amplitudes at the points [m].

    Examples:
        >>> Mesh._fields[:4]
        ('real', 'side', 'omega', 'centre')
    """

    real: Values
    side: Values
    omega: Values
    centre: Values
    chart: Any
    sine: Values
    cosine: Values
    branch: Values
    weight: Values
    integral: Values
    nodes: Values
    amplitudes: Values


def make_mesh(
    oscillator: Oscillator,
    forces: Forces,
    turning_points: Sequence[float] | np.ndarray,
    *,
    layout: Layout | None = None,
    half_cycles: int | None = None,
    centre: Literal["onset", "fastest"] = "onset",
    check: bool = False,
    previous: Mesh | None = None,
) -> Mesh:
    """Return the mesh of a decay from approximate turning points.

    Errors of some per cent in the turning points only cost iterations, because the equations are exact on every mesh.

    Args:
        oscillator: the machine, for kinks of its forces and for the coordinate of its spring.
        forces: its tables.
        turning_points: start and end of each half-cycle [m], of alternating sign, shape (real half-cycles + 1,), such
            as those of an earlier decay. NaN is left out.
        layout: panels and points; by default those of :func:`choose_layout`.
        half_cycles: number of half-cycles with padding; by default without padding.
        centre: friction force of the reference dead band: that at the onset of sliding, or that at the largest speed,
            which resolves some half-cycles that barely leave rest.
        check: other positions of the points, for an estimate of the error by a second mesh.
        previous: mesh of the same half-cycles with better amplitudes, such as those of a first motion. The new mesh
            begins with that motion, and its panels meet at the kinks of that motion.

    Raises:
        ValueError: fewer than two turning points, or more half-cycles than the padding allows.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import tabulate
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.01))
        >>> forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        >>> make_mesh(machine, forces, [1e-3, -0.8e-3, 0.6e-3]).sine.shape
        (2, 64)
    """
    points = np.asarray(turning_points, dtype=float)
    points = points[np.isfinite(points)]
    count = points.size - 1
    padded = count if half_cycles is None else half_cycles
    if not 1 <= count <= padded:
        raise ValueError(f"A mesh for {padded} half-cycles needs 2 to {padded + 1} turning points, got {points.size}.")
    layout = layout or choose_layout(oscillator, forces, points)
    frame = make_frame(oscillator, forces, points, centre, layout.grading)
    known, sketch = _sketch(frame, previous)
    crosses = np.ones(count, bool)
    if oscillator.restoring.hysteretic:
        # Internal friction of the spring has a kink at the equilibrium.
        towards = frame.centre[:, None] + sketch * np.cos(known)
        passing = _crossings(known, -towards, 0.0, late=False)
        # The last half-cycle may end before the equilibrium.
        crosses = np.isfinite(passing)
        frame = frame._replace(middle=np.where(crosses, passing, np.pi / 2))
    speed = frame.omega[:, None] * sketch * np.sin(known)
    edges = _panel_edges(frame, oscillator.friction.kink_speeds, layout.panels, known, speed, SHARES[check])
    integral, ranks = quadrature(layout.panels, layout.points)
    width = np.diff(edges)
    rank = edges[:, :-1, None] + width[:, :, None] * ranks
    late = np.broadcast_to(edges[:, :-1, None] >= 1, rank.shape)
    phase, slope = phase_of(frame, np.where(late, 2 - rank, rank), late, SHARES[check])
    sine, cosine = np.sin(phase), np.where(late, -1.0, 1.0) * np.cos(phase)
    weight = slope * width[:, :, None]
    beyond = late & crosses[:, None, None]
    branch = frame.side[:, None, None] * np.where(beyond, -1.0, 1.0) * oscillator.restoring.hysteretic
    sine, cosine, branch, weight = (each.reshape(count, -1) for each in (sine, cosine, branch, weight))
    nodes = np.delete(np.arange(sine.shape[1]), np.arange(1, layout.panels) * layout.points)
    phases = np.where(late, np.pi - phase, phase).reshape(count, -1)
    amplitudes = np.stack([np.interp(*each) for each in zip(phases, known, sketch, strict=True)])
    fill = functools.partial(_filled, count=padded)
    return Mesh(
        fill(np.ones(count, bool), False), fill(frame.side, 1.0), fill(frame.omega, frame.omega[-1]),
        fill(frame.centre, frame.centre[-1]), np.float64(frame.chart), fill(sine, 0.5), fill(cosine, 0.5),
        fill(branch, 0.0), fill(weight, 0.0), integral, nodes, fill(amplitudes, 1.0),
    )  # fmt: skip


def _crossings(phase: np.ndarray, values: np.ndarray, level: float, *, late: bool) -> np.ndarray:
    """Return the phase at which each row crosses a level, else NaN.

    It is the first rise above the level, or with `late` the last fall below it.
    """
    above, rows = values > level, np.arange(len(values))
    # The last sample below the level before the values rise above it, or the last sample above it.
    index = values.shape[1] - 1 - np.argmax(above[:, ::-1], axis=1) if late else np.argmax(above, axis=1) - 1
    index = np.clip(index, 0, values.shape[1] - 2)
    low, high = values[rows, index], values[rows, index + 1]
    there = phase[rows, index] + (level - low) / (high - low) * (phase[rows, index + 1] - phase[rows, index])
    return np.where(above.any(axis=1), there, np.nan)


def _panel_edges(
    frame: Frame, kinks: Sequence[float], panels: int, phase: np.ndarray, speed: np.ndarray, share: float
) -> np.ndarray:
    """Return the ranks of the edges of panels, from 0 to 2.

    The result has the shape (half_cycles, panels + 1). The middle and the kinks that the speed passes are edges;
    `phase` and `speed` sample the motion. Other edges divide the widest panels.
    """
    edges = np.tile([0.0, 1.0, 2.0], (frame.side.size, 1))
    rows = np.arange(len(edges))
    for kink in kinks:
        for late in (False, True):
            there = _crossings(phase, speed, kink, late=late)
            behind = there > frame.middle
            rank, _ = rank_of(frame, np.where(behind, np.pi - there, there), behind, share)
            edges = np.concatenate([edges, np.where(behind, 2 - rank, rank)[:, None]], axis=1)
    edges = np.sort(edges, axis=1)
    if edges.shape[1] > panels + 1 and np.isfinite(edges[:, panels + 1 :]).any():
        raise ValueError(f"The force has {len(kinks)} kinks, too many for {panels} panels.")
    edges = np.concatenate([edges, np.full((len(edges), panels), np.nan)], axis=1)[:, : panels + 1]
    while np.isnan(edges).any():
        width = np.nan_to_num(np.diff(edges))
        widest = np.argmax(width, axis=1)
        centre = edges[rows, widest] + width[rows, widest] / 2
        edges[:, -1] = np.where(np.isnan(edges[:, -1]), centre, edges[:, -1])
        edges = np.sort(edges, axis=1)
    return edges


def _sketch(frame: Frame, previous: Mesh | None) -> tuple[np.ndarray, np.ndarray]:
    """Return phases and amplitudes of an approximate motion.

    Arrays have the shape (half_cycles, samples). Without a previous mesh the amplitude changes linearly with the cosine
    of the phase.
    """
    count = frame.side.size
    if previous is None:
        phase = np.broadcast_to(np.linspace(0.0, np.pi, _SKETCH), (count, _SKETCH))
        return phase, frame.amplitude[:, None] + frame.growth[:, None] * (1 - np.cos(phase)) / 2
    amplitudes = np.asarray(previous.amplitudes)[:count]
    stretch = (previous.omega[:count] / frame.omega)[:, None]
    along = (previous.centre[:count] - frame.centre)[:, None] + amplitudes * previous.cosine[:count]
    across = stretch * amplitudes * previous.sine[:count]
    return np.arctan2(across, along), np.hypot(across, along)


def _filled(values: np.ndarray, fill: Any, count: int) -> np.ndarray:
    """Return the array with rows added up to that count."""
    return np.concatenate([values, np.full((count - len(values), *values.shape[1:]), fill)])
