"""Integrate and sample a free decay from tables of its forces."""

from typing import Any, NamedTuple

import numpy as np

from .forces import Forces, Values
from .lookup import value_and_slope
from .mesh import Mesh
from .nodes import Start, make_nodes, sample, sample_derivative
from .phase import LARGEST_CORRECTION, Rates, charted, iterate

# The lapse of time is one over the phase rate. A tenth of the undisturbed rate is the limit of the other engines too.
_SLOWEST_PHASE = 0.1


class Quality(NamedTuple):
    """Numbers that decide whether a decay is resolved, each of shape ().

    Attributes:
        correction: largest relative change of an amplitude by one more iteration [1], an estimate of the error that the
            iterations leave.
        phase_rate: smallest rate of the phase relative to the undisturbed rate [1].
        speed, travel: largest speed and displacement relative to the range of the tables [1].

    Examples:
        >>> Quality(1e-12, 0.9, 0.8, 0.9).phase_rate
        0.9
    """

    correction: Any
    phase_rate: Any
    speed: Any
    travel: Any


class Reversals(NamedTuple):
    """Turning points of a decay.

    Attributes:
        turning_points, excess, amplitudes: as in a `Decay`.

    Examples:
        >>> Reversals._fields
        ('turning_points', 'excess', 'amplitudes')
    """

    turning_points: Values
    excess: Values
    amplitudes: Values


class Decay(NamedTuple):
    """Motion at the samples, turning points and quality of a decay.

    Attributes:
        x: displacement [m], shape (samples,); NaN after the last half-cycle if the mass does not rest there.
        v: velocity [m/s], shape (samples,).
        columns: derivative of `x` at fixed time by each column of the tables [m per unit], shape (samples, columns).
        turning_points: start and end of each half-cycle [m], shape (half_cycles + 1,); NaN for padding.
        excess: pull of the spring beyond the static friction force at each turning point, per mass [m/s^2], same shape.
            A set-valued law requires a positive excess at the start of each half-cycle, and rest otherwise.
        duration: time at the end of the last half-cycle [s], shape ().
        amplitudes: amplitudes at the points of the mesh, shape (half_cycles, points), as a start of the next iteration.
        resolved: whether the points resolve the motion and the tables cover it, shape (). If not, another engine must
            integrate it: a half-cycle that barely leaves rest, a phase that runs backwards, iterations that do not
            converge, or NaN. Estimate the remaining error by :func:`fricjax.tables.error`.
        quality: numbers that decide it.
        derivative: derivative of `x` by time of the requested order, its columns, and its derivative by time; those of
            order 0 are `x`, `columns` and `v`.

    Examples:
        >>> "excess" in Decay._fields
        True
    """

    x: Values
    v: Values
    columns: Values
    turning_points: Values
    excess: Values
    duration: Values
    amplitudes: Values
    resolved: Any
    quality: Quality
    derivative: tuple[Values, Values, Values]


def decay(
    forces: Forces,
    mesh: Mesh,
    start: Start,
    ts: Values,
    rests: Any = True,
    iterations: Any = 6,
    xp: Any = np,
    order: int = 0,
) -> Decay:
    """Integrate all half-cycles of a decay and sample the motion.

    It is a pure function of arrays. Under JAX it can be compiled, batched by `jax.vmap` and differentiated forwards;
    :func:`fricjax.tables.solve` is its compiled form.

    Args:
        forces: tables of the machine.
        mesh: half-cycles with points and first approximation, from :func:`fricjax.tables.make_mesh`.
        start: initial displacement.
        ts: times of the samples after the release [s], shape (samples,); before it the mass is at its start.
        rests: whether the mass stays at the end of the last half-cycle, shape ().
        iterations: number of iterations. Each squares the relative error: 4 to 6 from rough turning points, 2 to 3 from
            the amplitudes at nearby coefficients.
        xp: `numpy` or `jax.numpy`.
        order: order of the derivative by time in `derivative`, 0 to 3.

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import make_mesh, tabulate
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.01))
        >>> forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        >>> mesh = make_mesh(machine, forces, [1e-3, -0.8e-3, 0.6e-3])
        >>> motion = decay(forces, mesh, Start(1e-3, np.eye(8)[7]), np.array([0.0, np.pi / 100]))
        >>> print([f"{x:.6f}" for x in motion.x], f"{motion.columns[1, 0]:.5f}")  # dx/dmu = 2 N/k
        ['0.001000', '-0.000800'] 0.02000
    """
    first = mesh.side[0] * charted(xp, mesh, start.x0) - mesh.centre[0]
    state = iterate(xp, forces, mesh, first, iterations)
    rates, real = state.rates, mesh.real[:, None]
    nodes = make_nodes(xp, forces, mesh, start, state)
    x, v, columns = sample(xp, nodes, xp.asarray(ts), rests)
    # Half-cycles after the last sample may lie behind the stop of the law.
    begins = nodes.t.reshape(mesh.real.shape[0], -1)[:, :1]
    real = real & ~(begins > xp.max(ts))
    change = xp.where(real, xp.abs(state.following / state.amplitudes - 1), 0.0)
    relative = xp.where(real, 1 / (rates.lapse * mesh.omega[:, None] * rates.slope), 1.0)
    speed = xp.where(real, rates.speed, 0.0) / forces.resisting.edges[-1]
    travel = xp.where(real, xp.abs(rates.x), 0.0) / forces.restoring.edges[-1]
    quality = Quality(xp.max(change), xp.min(relative), xp.max(speed), xp.max(travel))
    turning_points, excess = _rest_condition(xp, forces, mesh, rates)
    resolved = (quality.speed <= 1) & (quality.travel <= 1)
    resolved &= (quality.correction <= LARGEST_CORRECTION) & (quality.phase_rate >= _SLOWEST_PHASE)
    derivative = sample_derivative(xp, nodes, xp.asarray(ts), order) if order else (x, columns, v)
    ends = turning_points, excess, nodes.duration
    return Decay(x, v, columns, *ends, state.amplitudes, resolved, quality, derivative)


def reversals(forces: Forces, mesh: Mesh, x0: Any, iterations: Any = 6, xp: Any = np) -> Reversals:
    """Return the turning points of a decay, without samples and columns.

    The arguments are those of :func:`decay`; `x0` is the initial displacement [m].

    Examples:
        >>> import fricjax as fj
        >>> from fricjax.tables import make_mesh, tabulate
        >>> machine = fj.Oscillator(0.1, 1000.0, 0.0, 10.0, fj.friction.Coulomb(0.01))
        >>> forces = tabulate(machine, ["mu"], speed=0.2, travel=2e-3)
        >>> mesh = make_mesh(machine, forces, [1e-3, -0.8e-3, 0.6e-3])
        >>> reversals(forces, mesh, 1e-3).turning_points.round(6).tolist()
        [0.001, -0.0008, 0.0006]
    """
    state = iterate(xp, forces, mesh, mesh.side[0] * charted(xp, mesh, x0) - mesh.centre[0], iterations)
    return Reversals(*_rest_condition(xp, forces, mesh, state.rates), state.amplitudes)


def _rest_condition(xp: Any, forces: Forces, mesh: Mesh, rates: Rates) -> tuple[Any, Any]:
    """Return turning points and the pull beyond static friction there."""
    real, side, x = mesh.real, mesh.side, rates.x
    points = xp.concatenate([x[:1, 0], xp.where(real, x[:, -1], xp.nan)])
    # The next half-cycle begins on the other side of the table.
    index, local = (each[:, -1] for each in rates.travel_place)
    cells = np.int32(forces.restoring.centres.shape[-1])
    behind = value_and_slope(xp, forces.restoring, (xp.where(side > 0, index - cells, index + cells), local))[0]
    first = side[:1] * rates.restoring[:1, 0] - forces.breakaway
    return points, xp.concatenate([first, xp.where(real, -side * behind - forces.static, xp.nan)])
