"""Half-cycles of a decay with their points in phase.

Each half-cycle is divided into panels with Chebyshev points. The points are even in the rank

    share ln(1 + theta/layer)/ln(1 + half/layer) + (1 - share) theta/half

of the phase since the last, or until the next, reversal, so they are dense where friction changes fast. Edges of panels
lie at the phases at which the force has a kink. All numbers of a mesh stay fixed in a fit.
"""

import functools
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ..oscillator import Oscillator
from ..oscillator.restoring import Pendulum
from .forces import Curve, Forces, Values


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


class Layout(NamedTuple):
    """Points of a half-cycle.

    Meshes with the same numbers of panels and points share a compiled program.

    Attributes:
        panels: number of panels.
        points: number of points in each panel.
        grading: width of the dense part of the mesh over that of the layer in which friction changes fast.

    Examples:
        >>> Layout(2, 32).finer()
        Layout(panels=2, points=64, grading=1.0)
    """

    panels: int
    points: int
    grading: float = 1.0

    def finer(self) -> "Layout":
        """Return the layout with twice the points."""
        return self._replace(points=2 * self.points)


# Part of the points spread evenly over the logarithm of the distance from the layer, in a mesh and in the mesh that
# checks it. The rest is even in phase. Chosen, not derived; `experiments/tables/run.py` shows the resulting errors.
_SHARES = (0.6, 0.45)
# Newton steps to the phase of a rank; from the logarithmic part alone as the start, ten reach rounding error.
_NEWTON_STEPS = 12
# Layouts for a force without kinks, in the order of trial. The last two resolve powers of the speed below one.
_LAYOUTS = (Layout(2, 32), Layout(2, 64), Layout(2, 64, 1e-2), Layout(2, 64, 1e-4))
# Samples of the first approximation of a motion. The phase of a kink is off by (pi/256)^2/8 = 2e-5 by interpolation,
# far less than by rough turning points.
_SKETCH = 257
# Panels and points that resolve any force on the host, over a layer of 1e-9 rad, the thinnest one of a mesh.
_REFERENCE, _THINNEST = Layout(8, 32), 1e-9
# Relative error of the impulses of friction and its derivatives that a layout may have. Errors of the columns of the
# result are up to a hundred times larger (`experiments/tables/run.py`), and a fit demands 1e-7.
_IMPULSE_ERROR = 1e-9


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
        turning_points: start and end of each half-cycle [m], of alternating sign, shape (real half-cycles + 1,).
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
    count = points.size - 1
    padded = count if half_cycles is None else half_cycles
    if not 1 <= count <= padded:
        raise ValueError(f"A mesh for {padded} half-cycles needs 2 to {padded + 1} turning points, got {points.size}.")
    layout = layout or choose_layout(oscillator, forces, points)
    frame = _frame(oscillator, forces, points, centre, layout.grading)
    known, sketch = _sketch(frame, previous)
    if oscillator.restoring.hysteretic:
        # Internal friction of the spring has a kink at the equilibrium.
        towards = frame.centre[:, None] + sketch * np.cos(known)
        frame = frame._replace(middle=_crossings(known, -towards, 0.0, late=False))
    speed = frame.omega[:, None] * sketch * np.sin(known)
    edges = _panel_edges(frame, oscillator.friction.kink_speeds, layout.panels, known, speed, _SHARES[check])
    integral, ranks = _quadrature(layout.panels, layout.points)
    width = np.diff(edges)
    rank = edges[:, :-1, None] + width[:, :, None] * ranks
    late = np.broadcast_to(edges[:, :-1, None] >= 1, rank.shape)
    phase, slope = _phase(frame, np.where(late, 2 - rank, rank), late, _SHARES[check])
    sine, cosine = np.sin(phase), np.where(late, -1.0, 1.0) * np.cos(phase)
    weight = slope * width[:, :, None]
    branch = frame.side[:, None, None] * np.where(late, -1.0, 1.0) * oscillator.restoring.hysteretic
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


class _Frame(NamedTuple):
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


def _frame(
    oscillator: Oscillator, forces: Forces, points: np.ndarray, centre: str = "onset", grading: float = 1.0
) -> _Frame:
    restoring = oscillator.restoring
    chart = isinstance(restoring, Pendulum)
    q, slope = (2 * np.sin(points / 2), np.cos(points[:-1] / 2)) if chart else (points, np.ones(points.size - 1))
    side = np.where(points[:-1] < 0, -1.0, 1.0)
    omega = np.sqrt(np.abs(_read(forces.restoring, side, points[:-1])) / np.abs(q[:-1] * slope))
    friction = np.full(side.size, forces.onset)
    if centre == "fastest":
        swing = np.abs(np.diff(q)) / 2
        friction = _read(forces.resisting, side, omega * swing)
    dead_band = friction / omega**2
    amplitude = side * q[:-1] - dead_band
    growth = dead_band - side * q[1:] - amplitude
    largest = np.maximum(amplitude, amplitude + growth)
    layer = grading * forces.velocity_scale / (omega * np.maximum(largest, np.finfo(float).tiny))
    if chart:
        # The lapse of time has poles where the slope of the coordinate vanishes, arctanh(slope) from the reversals.
        layer = np.minimum(layer, np.arctanh(np.clip(slope, 1e-6, 1 - 1e-6)))
    middle = np.full(side.size, np.pi / 2)
    return _Frame(chart, side, omega, dead_band, amplitude, growth, np.clip(layer, _THINNEST, 1e3), middle)


def _read(curve: Curve, side: np.ndarray, at: np.ndarray, columns: bool = False) -> np.ndarray:
    """Return values of a curve on the host.

    With `columns`, a first axis has the slope, the value and the columns.
    """
    cells = curve.centres.size
    cell = np.clip(np.searchsorted(curve.edges, at, side="right") - 1, 0, cells - 1)
    local = (at - curve.centres[cell]) * curve.scales[cell]
    table = np.concatenate([curve.value[:, None], curve.columns], axis=1) if columns else curve.value[:, None]
    powers = table[..., cell + cells * (side > 0)]
    value, slope = powers[-1], np.zeros_like(local)
    for power in powers[-2::-1]:
        slope = slope * local + value[0]
        value = value * local + power
    return np.concatenate([slope[None] * curve.scales[cell], value]) if columns else value[0]


def _rank(frame: _Frame, phase: np.ndarray, late: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the rank of a phase and its slope.

    Arrays have the half-cycles along the first axis.
    """
    axes = (slice(None), *(None,) * (phase.ndim - 1))
    layer, middle = frame.layer[axes], frame.middle[axes]
    half = np.where(late, np.pi - middle, middle)
    span = np.log1p(half / layer)
    rank = share * np.log1p(phase / layer) / span + (1 - share) * phase / half
    return rank, share / (span * (layer + phase)) + (1 - share) / half


def _phase(frame: _Frame, rank: np.ndarray, late: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the phase at a rank by Newton's method, and its slope.

    The rank is concave in the phase and at most its logarithmic part, so the steps rise to the solution.
    """
    axes = (slice(None), *(None,) * (rank.ndim - 1))
    layer, middle = frame.layer[axes], frame.middle[axes]
    phase = layer * np.expm1(rank * np.log1p(np.where(late, np.pi - middle, middle) / layer))
    for _ in range(_NEWTON_STEPS):
        value, rise = _rank(frame, phase, late, share)
        phase = phase + (rank - value) / rise
    return np.where(rank > 0, phase, 0.0), 1 / _rank(frame, phase, late, share)[1]


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
    frame: _Frame, kinks: Sequence[float], panels: int, phase: np.ndarray, speed: np.ndarray, share: float
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
            rank, _ = _rank(frame, np.where(behind, np.pi - there, there), behind, share)
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


def _sketch(frame: _Frame, previous: Mesh | None) -> tuple[np.ndarray, np.ndarray]:
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


@functools.cache
def _quadrature(panels: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix of integrals and ranks of points in a panel."""
    places = -np.cos(np.pi * np.arange(points) / (points - 1))
    coefficients = np.linalg.inv(chebyshev.chebvander(places, points - 1))
    unit = np.identity(points)
    columns = [chebyshev.chebval(places, chebyshev.chebint(row, lbnd=-1)) for row in unit]
    inside = np.stack(columns, axis=1) @ coefficients / 2
    before = np.tile(inside[-1], (points, 1))
    blocks = [[inside if i == j else before * (j < i) for j in range(panels)] for i in range(panels)]
    return np.ascontiguousarray(np.block(blocks).T), (1 + places) / 2


def _filled(values: np.ndarray, fill: Any, count: int) -> np.ndarray:
    """Return the array with rows added up to that count."""
    return np.concatenate([values, np.full((count - len(values), *values.shape[1:]), fill)])


def choose_layout(oscillator: Oscillator, forces: Forces, turning_points: Sequence[float] | np.ndarray) -> Layout:
    """Return the smallest layout that resolves the resisting force.

    The test integrates the force, its slope and its derivatives by the coefficients over the first and the last
    half-cycle, and compares the results with those of a fine mesh. A force with kinks has a panel for each interval
    between them.

    Args:
        oscillator: the machine, for kinks of its forces.
        forces: its tables.
        turning_points: as in :func:`make_mesh`.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import tabulate
        >>> for law in (fj.friction.Coulomb(0.01), fj.friction.Tanh(0.01, 1e-4)):
        ...     machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, law)
        ...     forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        ...     print(choose_layout(machine, forces, [1e-3, -0.8e-3, 0.6e-3]))
        Layout(panels=2, points=32, grading=1.0)
        Layout(panels=2, points=64, grading=1.0)
    """
    fastest = forces.resisting.edges[-1]
    if kinks := len([kink for kink in oscillator.friction.kink_speeds if kink < fastest]):
        # Each kink is passed before and after the middle.
        return Layout(max(8, 1 << (2 * kinks + 1).bit_length()), 16)
    frame = _frame(oscillator, forces, np.asarray(turning_points, dtype=float))
    ends = frame._replace(**{name: getattr(frame, name)[[0, -1]] for name in frame._fields if name != "chart"})
    exact = _impulses(forces, ends._replace(layer=np.full(2, _THINNEST)), _REFERENCE)
    scale = np.max(np.abs(exact), axis=(0, 2))
    # The slope of a constant force is rounding error.
    scale[0] = max(scale[0], scale[1])
    used = scale > 0
    best, least = _LAYOUTS[0], np.inf
    for layout in _LAYOUTS:
        layer = np.clip(layout.grading * ends.layer, _THINNEST, 1e3)
        # A panel covers half of the half-cycle.
        trial = _impulses(forces, ends._replace(layer=layer), Layout(1, layout.points))
        error = np.max((np.max(np.abs(trial - exact), axis=(0, 2)) / np.where(used, scale, 1.0))[used], initial=0.0)
        if error < least:
            best, least = layout, error
        if least < _IMPULSE_ERROR:
            break
    return best


def _impulses(forces: Forces, frame: _Frame, layout: Layout) -> np.ndarray:
    """Integrate the resisting force over the first half of each half-cycle.

    Its slope and its columns are integrated too. The weights are the sine and the cosine of the phase, by which a force
    acts on amplitude and time.

    Returns:
        Shape (2, 3 + columns, half_cycles); the last integrand is the lapse of time of the coordinate.
    """
    integral, ranks = _quadrature(layout.panels, layout.points)
    rank = (np.arange(layout.panels)[:, None] + ranks) / layout.panels
    rank = np.broadcast_to(rank.ravel(), (frame.side.size, rank.size))
    phase, slope = _phase(frame, rank, np.zeros(rank.shape, bool), _SHARES[0])
    amplitude = frame.amplitude[:, None] + frame.growth[:, None] * (1 - np.cos(phase)) / 2
    speed = frame.omega[:, None] * amplitude * np.sin(phase)
    values = _read(forces.resisting, frame.side[:, None], speed, True)
    values[0] *= speed
    # The lapse of a half-cycle without friction; it is constant but for a pendulum.
    q = frame.chart * (frame.centre[:, None] + amplitude * np.cos(phase)) / 2
    values = np.concatenate([values, 1 / np.sqrt(1 - q[None] ** 2)])
    weights = np.stack([np.sin(phase), np.cos(phase)]) * slope / layout.panels
    return np.einsum("cnp,wnp,p->wcn", values, weights, integral[:, -1])
