"""Free decays in phase angle, all half-cycles at once, with derivatives.

A half-cycle that begins at a turning point on the side ``s`` has the coordinate ``q = s (q_d + A cos theta)`` and the
velocity ``v = -s omega A sin theta``, with fixed ``omega`` and ``q_d``. ``D`` is the resisting and ``r`` the restoring
force per mass, ``K = D - s r``, and ``S = dq/dx`` the slope of the coordinate. Variation of parameters gives

    dtheta/dt = omega S sin^2 theta - K cos theta/(omega A)
    dA/dt = -sin theta (omega S A cos theta + K/omega)

These equations are exact for every ``omega`` and ``q_d`` for which the phase advances, so both are numbers of the mesh
and have no derivatives. ``g = dA/dtheta`` of all half-cycles is linearised about the last approximation and solved by
quadrature (quasilinearisation, Bellman and Kalaba 1965): with ``E = exp(int g_A)`` follows
``A = E (A_0 + int (g - g_A A)/E)``. The reversal to the next half-cycle, ``A_0' = A(pi) - q_d - q_d'``, is a linear
recursion, which a cumulative product solves. A change of a coefficient obeys the same linear equation with the source
``dg``. The same lines run under `numpy` and under `jax.numpy`. There is no loop over time, no event and no branch.
"""

from typing import Any, NamedTuple

import jax
import numpy as np

from .forces import Curve, Forces, Values
from .mesh import Mesh

_TINY = float(np.finfo(float).tiny)
# The correction is the error of an amplitude that the iterations leave: 2e-3 nm of 2 mm.
_LARGEST_CORRECTION = 1e-9
# The lapse of time is one over the phase rate. A tenth of the undisturbed rate is the limit of the other engines too.
_SLOWEST_PHASE = 0.1


class Start(NamedTuple):
    """Start from rest.

    Attributes:
        x0: initial displacement [m], shape (); it is on the side of the first half-cycle of the mesh.
        columns: derivative of `x0` by each column of the tables, shape (columns,).

    Examples:
        >>> Start(2e-3, np.eye(8)[7]).columns.shape
        (8,)
    """

    x0: Any
    columns: Values


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


def decay(
    forces: Forces,
    mesh: Mesh,
    start: Start,
    ts: Values,
    rests: Any = True,
    iterations: Any = 6,
    xp: Any = np,
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
    first = mesh.side[0] * _charted(xp, mesh, start.x0) - mesh.centre[0]
    state = _iterate(xp, forces, mesh, first, iterations)
    rates, real = state.rates, mesh.real[:, None]
    nodes = _nodes(xp, forces, mesh, start, state)
    x, v, columns = _sample(xp, nodes, xp.asarray(ts), rests)
    change = xp.where(real, xp.abs(state.following / state.amplitudes - 1), 0.0)
    relative = xp.where(real, 1 / (rates.lapse * mesh.omega[:, None] * rates.slope), 1.0)
    speed = xp.where(real, rates.speed, 0.0) / forces.resisting.edges[-1]
    travel = xp.where(real, xp.abs(rates.x), 0.0) / forces.restoring.edges[-1]
    quality = Quality(xp.max(change), xp.min(relative), xp.max(speed), xp.max(travel))
    turning_points, excess = _rest_condition(xp, forces, mesh, rates)
    resolved = (quality.speed <= 1) & (quality.travel <= 1)
    resolved &= (quality.correction <= _LARGEST_CORRECTION) & (quality.phase_rate >= _SLOWEST_PHASE)
    return Decay(x, v, columns, turning_points, excess, nodes.duration, state.amplitudes, resolved, quality)


class _Rates(NamedTuple):
    """Rates over phase at all points, with derivatives.

    Arrays have the shape (half_cycles, points). `lapse` is dt/dtheta and `growth` dA/dtheta. The suffix `_slope` marks
    derivatives by the amplitude and `_source` those by the force ``K``.
    """

    lapse: Any
    growth: Any
    lapse_slope: Any
    growth_slope: Any
    lapse_source: Any
    growth_source: Any
    x: Any
    slope: Any
    speed: Any
    resisting: Any
    resisting_slope: Any
    restoring: Any
    restoring_slope: Any
    speed_place: tuple[Any, Any]
    travel_place: tuple[Any, Any]


class _State(NamedTuple):
    """Result of an iteration.

    Attributes:
        following: amplitudes after the iteration.
        amplitudes: those before it.
        rates: rates at `amplitudes`.
        exponent: integral of `growth_slope` from the start of the half-cycle.
    """

    following: Any
    amplitudes: Any
    rates: _Rates
    exponent: Any


class _Nodes(NamedTuple):
    """Motion at the nodes in order of time.

    Attributes:
        t: times [s], shape (nodes,).
        motion: x, v and a with their columns at fixed time, shape (nodes, 3, 1 + columns).
        end: last turning point with its columns, shape (1 + columns,).
        duration: time of the last turning point [s].
    """

    t: Any
    motion: Any
    end: Any
    duration: Any


def _once(xp: Any, values: Any) -> Any:
    """Keep the compiler from recomputing these values at each use.

    Without it XLA evaluates the columns four times.
    """
    return values if xp is np else jax.lax.optimization_barrier(values)


def _charted(xp: Any, mesh: Mesh, x: Any) -> Any:
    """Return the coordinate, 2 sin(x/2) for a pendulum, else x."""
    return xp.where(mesh.chart > 0, 2 * xp.sin(x / 2), x)


def _place(xp: Any, curve: Curve, side: Any, at: Any, branch: Any = None) -> tuple[Any, Any]:
    """Return index and local coordinate of the cells at `at`.

    Where `branch` is 1 or -1, the cell is one for positive or negative values, even if `at` is just beyond zero.
    """
    cells = curve.centres.shape[-1]
    cell_of = at if branch is None else xp.where(branch == 0, at, branch * xp.maximum(branch * at, _TINY))
    cell = xp.clip(xp.searchsorted(curve.edges, cell_of, side="right") - 1, 0, cells - 1).astype(np.int32)
    local = (at - xp.take(curve.centres, cell, mode="clip")) * xp.take(curve.scales, cell, mode="clip")
    return _once(xp, (xp.where(side > 0, cell + np.int32(cells), cell), local))


def _value(xp: Any, curve: Curve, place: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return value and slope of a curve by Horner's rule."""
    index, local = place
    powers = xp.take(curve.value, index, axis=-1, mode="clip")
    value, slope = powers[-1], xp.zeros_like(local)
    for power in range(powers.shape[0] - 2, -1, -1):
        slope = slope * local + value
        value = value * local + powers[power]
    cells = np.int32(curve.scales.shape[-1])
    return value, slope * xp.take(curve.scales, xp.where(index >= cells, index - cells, index), mode="clip")


def _columns(xp: Any, curve: Curve, place: tuple[Any, Any]) -> Any:
    """Return derivatives by the coefficients, shape (columns, half_cycles, points)."""
    powers = xp.take(curve.columns, place[0], axis=-1, mode="clip")
    value = powers[-1]
    for power in range(powers.shape[0] - 2, -1, -1):
        value = value * place[1] + powers[power]
    return value


def _rates(xp: Any, forces: Forces, mesh: Mesh, amplitudes: Any) -> _Rates:
    omega, side, centre = mesh.omega[:, None], mesh.side[:, None], mesh.centre[:, None]
    sine, cosine = mesh.sine, mesh.cosine
    speed, q = omega * amplitudes * sine, side * (centre + amplitudes * cosine)
    half = mesh.chart * q / 2
    slope = xp.sqrt(1 - half * half)
    slope_change = -0.5 * mesh.chart * half * side * cosine / slope
    x = xp.where(mesh.chart > 0, 2 * xp.arcsin(half), q)
    speed_place = _place(xp, forces.resisting, side, speed)
    travel_place = _place(xp, forces.restoring, side, x, mesh.branch)
    resisting, resisting_slope = _once(xp, _value(xp, forces.resisting, speed_place))
    restoring, restoring_slope = _once(xp, _value(xp, forces.restoring, travel_place))
    force = resisting - side * restoring
    force_change = resisting_slope * omega * sine - restoring_slope * cosine / slope
    turn = -cosine / (omega * amplitudes)
    rate = omega * slope * sine * sine + force * turn
    rate_change = omega * slope_change * sine * sine + (force_change - force / amplitudes) * turn
    gain = -sine * (omega * slope * amplitudes * cosine + force / omega)
    gain_change = -sine * (omega * cosine * (slope + amplitudes * slope_change) + force_change / omega)
    lapse = 1 / rate
    growth = gain * lapse
    result = _Rates(
        lapse,
        growth,
        -rate_change * lapse * lapse,
        (gain_change - growth * rate_change) * lapse,
        -turn * lapse * lapse,
        (-sine / omega - growth * turn) * lapse,
        x,
        slope,
        speed,
        resisting,
        resisting_slope,
        restoring,
        restoring_slope,
        speed_place,
        travel_place,
    )
    return _once(xp, result)


def _iterate(xp: Any, forces: Forces, mesh: Mesh, first: Any, iterations: Any) -> _State:
    """Return the state after the iterations and one more."""

    def closer(_: Any, state: _State) -> _State:
        amplitudes = state.following
        rates = _rates(xp, forces, mesh, amplitudes)
        exponent = _once(xp, (rates.growth_slope * mesh.weight) @ mesh.integral)
        factor = _once(xp, xp.exp(exponent))
        rest = (rates.growth - rates.growth_slope * amplitudes) * mesh.weight
        gain = (rest / factor) @ mesh.integral
        centres = mesh.centre + xp.concatenate([mesh.centre[1:], mesh.centre[-1:]])
        begin = _recursion(xp, mesh, exponent[:, -1], factor[:, -1] * gain[:, -1] - centres, first)
        following = xp.where(mesh.real[:, None], factor * (begin[:, None] + gain), 1.0)
        return _State(following, amplitudes, rates, exponent)

    begin, zero = xp.asarray(mesh.amplitudes), xp.zeros(mesh.sine.shape)
    place = (xp.zeros(mesh.sine.shape, np.int32), zero)
    numbers: dict[str, Any] = dict.fromkeys(_Rates._fields, zero)
    state = _State(begin, begin, _Rates(**numbers)._replace(speed_place=place, travel_place=place), zero)
    if xp is np:
        for i in range(int(iterations) + 1):
            state = closer(i, state)
        return state
    return jax.lax.fori_loop(0, iterations + 1, closer, state)


def _recursion(xp: Any, mesh: Mesh, exponent: Any, shift: Any, first: Any) -> Any:
    """Solve ``y[n+1] = exp(exponent[n]) y[n] + shift[n]``.

    Half-cycles are along the last axis. Sums over earlier half-cycles are products with a triangular matrix, which
    compile faster than cumulative sums.
    """
    earlier = xp.tri(mesh.real.shape[0], k=-1).T
    exponent, shift = xp.where(mesh.real, exponent, 0.0), xp.where(mesh.real, shift, 0.0)
    before = exponent @ earlier
    return xp.exp(before) * (xp.asarray(first)[..., None] + (shift * xp.exp(-before - exponent)) @ earlier)


def _nodes(xp: Any, forces: Forces, mesh: Mesh, start: Start, state: _State) -> _Nodes:
    """Return the motion at the nodes and its columns."""
    rates, exponent = state.rates, state.exponent
    side, omega, real = mesh.side[:, None], mesh.omega[:, None], mesh.real
    resisting_columns = _once(xp, _columns(xp, forces.resisting, rates.speed_place))
    restoring_columns = _once(xp, _columns(xp, forces.restoring, rates.travel_place))
    source = resisting_columns - side * restoring_columns
    factor = _once(xp, xp.exp(exponent))
    gain = (rates.growth_source * source * mesh.weight / factor) @ mesh.integral
    # The slope of the coordinate at the start carries the derivative of the initial displacement.
    first = mesh.side[0] * rates.slope[0, 0] * start.columns
    begin = _recursion(xp, mesh, exponent[:, -1], factor[:, -1] * gain[..., -1], first)
    changes = _once(xp, factor * (begin[..., None] + gain))
    t, duration = _elapsed(xp, real, (rates.lapse * mesh.weight) @ mesh.integral)
    lapse_changes = rates.lapse_slope * changes + rates.lapse_source * source
    t_columns = _once(xp, _elapsed(xp, real, (lapse_changes * mesh.weight) @ mesh.integral)[0])
    v, a = -side * rates.speed, side * rates.resisting - rates.restoring
    x_columns = side * mesh.cosine * changes / rates.slope
    end_columns = x_columns[..., -1]
    x_columns = x_columns - v * t_columns
    v_columns = -side * omega * mesh.sine * changes - a * t_columns
    a_columns = side * resisting_columns - restoring_columns
    a_columns = a_columns - rates.resisting_slope * v_columns - rates.restoring_slope * x_columns
    pairs = ((rates.x, x_columns), (v, v_columns), (a, a_columns))
    motion = xp.stack([xp.concatenate([value[None], columns]) for value, columns in pairs])
    # Neighbouring panels share a point.
    motion = xp.take(motion, mesh.nodes, axis=-1, mode="clip")
    t = xp.take(xp.where(real[:, None], t, duration), mesh.nodes, axis=-1, mode="clip")
    last = xp.sum(real) - 1
    end = xp.concatenate([rates.x[last, -1][None], end_columns[:, last]])
    return _Nodes(t.reshape(-1), xp.moveaxis(motion.reshape(*motion.shape[:2], -1), -1, 0), end, duration)


def _elapsed(xp: Any, real: Any, lapse: Any) -> tuple[Any, Any]:
    """Return the time at the points, and the duration of all half-cycles."""
    full = xp.where(real, lapse[..., -1], 0.0)
    return (full @ xp.tri(full.shape[-1], k=-1).T)[..., None] + lapse, xp.sum(full, axis=-1)


def _sample(xp: Any, nodes: _Nodes, ts: Any, rests: Any) -> tuple[Any, Any, Any]:
    """Interpolate displacement, velocity and columns by quintic Hermite polynomials."""
    at = xp.clip(ts, 0.0, nodes.duration)
    index = xp.clip(xp.searchsorted(nodes.t, at, side="right") - 1, 0, nodes.t.shape[-1] - 2)
    begin = xp.take(nodes.t, index, mode="clip")
    step = xp.take(nodes.t, index + 1, mode="clip") - begin
    # At a reversal two nodes have the same time, and the acceleration jumps.
    step = xp.where(step > 0, step, 1.0)
    weights, slopes = _hermite(xp, (at - begin) / step, step)
    left = xp.take(nodes.motion, index, axis=0, mode="clip")
    right = xp.take(nodes.motion, index + 1, axis=0, mode="clip")
    values = xp.einsum("sk,skc->sc", weights[:, :3], left) + xp.einsum("sk,skc->sc", weights[:, 3:], right)
    v = xp.sum(slopes[:, :3] * left[:, :, 0] + slopes[:, 3:] * right[:, :, 0], axis=-1)
    behind = ts > nodes.duration
    values = xp.where(behind[:, None], xp.where(rests, nodes.end, xp.nan), values)
    v = xp.where(behind, xp.where(rests, 0.0, xp.nan), xp.where(ts > 0, v, 0.0))
    return values[:, 0], v, values[:, 1:]


def _hermite(xp: Any, q: Any, step: Any) -> tuple[Any, Any]:
    """Return weights of (x, v, a) at the ends of a step.

    The first ones are for the value at the fraction q of the step, the second ones for the slope, shape (samples, 6).
    """
    q2, p = q * q, 1 - q
    q3, p3 = q2 * q, p * p * p
    rise = q3 * (10 - 15 * q + 6 * q2)
    values = (
        1 - rise,
        step * (q - q3 * (6 - 8 * q + 3 * q2)),
        step * step * 0.5 * q2 * p3,
        rise,
        -step * q3 * (4 - 7 * q + 3 * q2),
        step * step * 0.5 * q3 * p * p,
    )
    steep = 30 * q2 * p * p / step
    slopes = (
        -steep,
        1 - q2 * (18 - 32 * q + 15 * q2),
        step * 0.5 * q * p * p * (2 - 5 * q),
        steep,
        -q2 * (12 - 28 * q + 15 * q2),
        step * 0.5 * q2 * p * (3 - 5 * q),
    )
    return xp.stack(values, axis=-1), xp.stack(slopes, axis=-1)


def _rest_condition(xp: Any, forces: Forces, mesh: Mesh, rates: _Rates) -> tuple[Any, Any]:
    """Return turning points and the pull beyond static friction there."""
    real, side, x = mesh.real, mesh.side, rates.x
    points = xp.concatenate([x[:1, 0], xp.where(real, x[:, -1], xp.nan)])
    # The next half-cycle begins on the other side of the table.
    index, local = (each[:, -1] for each in rates.travel_place)
    cells = np.int32(forces.restoring.centres.shape[-1])
    behind = _value(xp, forces.restoring, (xp.where(side > 0, index - cells, index + cells), local))[0]
    first = side[:1] * rates.restoring[:1, 0] - forces.breakaway
    return points, xp.concatenate([first, xp.where(real, -side * behind - forces.static, xp.nan)])
