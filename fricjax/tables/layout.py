"""Numbers of panels and points that resolve a force."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ..oscillator import Oscillator
from .forces import Forces
from .frame import SHARES, THINNEST, WIDEST, Frame, make_frame, phase_of
from .lookup import read


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


# Layouts for a force without kinks, in the order of trial. The last two resolve powers of the speed below one.
_LAYOUTS = (Layout(2, 32), Layout(2, 64), Layout(2, 64, 1e-2), Layout(2, 64, 1e-4))


# Panels and points that resolve any force on the host, over the thinnest layer.
_REFERENCE = Layout(8, 32)


# Relative error of the impulses of friction and its derivatives that a layout may have. Errors of the columns of the
# result are up to a hundred times larger (`experiments/tables/run.py`), and a fit demands 1e-7.
_IMPULSE_ERROR = 1e-9


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
    frame = make_frame(oscillator, forces, np.asarray(turning_points, dtype=float))
    ends = frame._replace(**{name: getattr(frame, name)[[0, -1]] for name in frame._fields if name != "chart"})
    exact = _impulses(forces, ends._replace(layer=np.full(2, THINNEST)), _REFERENCE)
    scale = np.max(np.abs(exact), axis=(0, 2))
    # The slope of a constant force is rounding error.
    scale[0] = max(scale[0], scale[1])
    used = scale > 0
    best, least = _LAYOUTS[0], np.inf
    for layout in _LAYOUTS:
        layer = np.clip(layout.grading * ends.layer, THINNEST, WIDEST)
        # A panel covers half of the half-cycle.
        trial = _impulses(forces, ends._replace(layer=layer), Layout(1, layout.points))
        error = np.max((np.max(np.abs(trial - exact), axis=(0, 2)) / np.where(used, scale, 1.0))[used], initial=0.0)
        if error < least:
            best, least = layout, error
        if least < _IMPULSE_ERROR:
            break
    return best


def _impulses(forces: Forces, frame: Frame, layout: Layout) -> np.ndarray:
    """Integrate the resisting force over the first half of each half-cycle.

    Its slope and its columns are integrated too. The weights are the sine and the cosine of the phase, by which a force
    acts on amplitude and time.

    Returns:
        Shape (2, 3 + columns, half_cycles); the last integrand is the lapse of time of the coordinate.
    """
    integral, ranks = quadrature(layout.panels, layout.points)
    rank = (np.arange(layout.panels)[:, None] + ranks) / layout.panels
    rank = np.broadcast_to(rank.ravel(), (frame.side.size, rank.size))
    phase, slope = phase_of(frame, rank, np.zeros(rank.shape, bool), SHARES[0])
    amplitude = frame.amplitude[:, None] + frame.growth[:, None] * (1 - np.cos(phase)) / 2
    speed = frame.omega[:, None] * amplitude * np.sin(phase)
    values = read(forces.resisting, frame.side[:, None], speed, True)
    values[0] *= speed
    # The lapse of a half-cycle without friction; it is constant but for a pendulum.
    q = frame.chart * (frame.centre[:, None] + amplitude * np.cos(phase)) / 2
    values = np.concatenate([values, 1 / np.sqrt(1 - q[None] ** 2)])
    weights = np.stack([np.sin(phase), np.cos(phase)]) * slope / layout.panels
    return np.einsum("cnp,wnp,p->wcn", values, weights, integral[:, -1])


@functools.cache
def quadrature(panels: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix of integrals and ranks of points in a panel."""
    places = -np.cos(np.pi * np.arange(points) / (points - 1))
    coefficients = np.linalg.inv(chebyshev.chebvander(places, points - 1))
    unit = np.identity(points)
    columns = [chebyshev.chebval(places, chebyshev.chebint(row, lbnd=-1)) for row in unit]
    inside = np.stack(columns, axis=1) @ coefficients / 2
    before = np.tile(inside[-1], (points, 1))
    blocks = [[inside if i == j else before * (j < i) for j in range(panels)] for i in range(panels)]
    return np.ascontiguousarray(np.block(blocks).T), (1 + places) / 2
