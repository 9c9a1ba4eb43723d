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

from .forces import Forces
from .lookup import once, place, value_and_slope
from .mesh import Mesh

LARGEST_CORRECTION = 1e-9
"""Largest error of an amplitude that the iterations may leave, relative to it: 2e-3 nm of 2 mm."""


class Rates(NamedTuple):
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


class State(NamedTuple):
    """Result of an iteration.

    Attributes:
        following: amplitudes after the iteration.
        amplitudes: those before it.
        rates: rates at `amplitudes`.
        exponent: integral of `growth_slope` from the start of the half-cycle.
    """

    following: Any
    amplitudes: Any
    rates: Rates
    exponent: Any


def charted(xp: Any, mesh: Mesh, x: Any) -> Any:
    """Return the coordinate, 2 sin(x/2) for a pendulum, else x."""
    return xp.where(mesh.chart > 0, 2 * xp.sin(x / 2), x)


def rates_at(xp: Any, forces: Forces, mesh: Mesh, amplitudes: Any) -> Rates:
    """Return the rates of the equations above at these amplitudes."""
    omega, side, centre = mesh.omega[:, None], mesh.side[:, None], mesh.centre[:, None]
    sine, cosine = mesh.sine, mesh.cosine
    speed, q = omega * amplitudes * sine, side * (centre + amplitudes * cosine)
    half = mesh.chart * q / 2
    slope = xp.sqrt(1 - half * half)
    slope_change = -0.5 * mesh.chart * half * side * cosine / slope
    x = xp.where(mesh.chart > 0, 2 * xp.arcsin(half), q)
    speed_place = place(xp, forces.resisting, side, speed)
    travel_place = place(xp, forces.restoring, side, x, mesh.branch)
    resisting, resisting_slope = once(xp, value_and_slope(xp, forces.resisting, speed_place))
    restoring, restoring_slope = once(xp, value_and_slope(xp, forces.restoring, travel_place))
    force = resisting - side * restoring
    force_change = resisting_slope * omega * sine - restoring_slope * cosine / slope
    turn = -cosine / (omega * amplitudes)
    rate = omega * slope * sine * sine + force * turn
    rate_change = omega * slope_change * sine * sine + (force_change - force / amplitudes) * turn
    gain = -sine * (omega * slope * amplitudes * cosine + force / omega)
    gain_change = -sine * (omega * cosine * (slope + amplitudes * slope_change) + force_change / omega)
    lapse = 1 / rate
    growth = gain * lapse
    result = Rates(
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
    return once(xp, result)


def iterate(xp: Any, forces: Forces, mesh: Mesh, first: Any, iterations: Any) -> State:
    """Return the state after the iterations and one more."""

    def closer(_: Any, state: State) -> State:
        amplitudes = state.following
        rates = rates_at(xp, forces, mesh, amplitudes)
        exponent = once(xp, (rates.growth_slope * mesh.weight) @ mesh.integral)
        factor = once(xp, xp.exp(exponent))
        rest = (rates.growth - rates.growth_slope * amplitudes) * mesh.weight
        gain = (rest / factor) @ mesh.integral
        centres = mesh.centre + xp.concatenate([mesh.centre[1:], mesh.centre[-1:]])
        begin = recursion(xp, mesh, exponent[:, -1], factor[:, -1] * gain[:, -1] - centres, first)
        following = xp.where(mesh.real[:, None], factor * (begin[:, None] + gain), 1.0)
        return State(following, amplitudes, rates, exponent)

    begin, zero = xp.asarray(mesh.amplitudes), xp.zeros(mesh.sine.shape)
    place = (xp.zeros(mesh.sine.shape, np.int32), zero)
    numbers: dict[str, Any] = dict.fromkeys(Rates._fields, zero)
    state = State(begin, begin, Rates(**numbers)._replace(speed_place=place, travel_place=place), zero)
    if xp is np:
        for i in range(int(iterations) + 1):
            state = closer(i, state)
            if i and np.all(np.abs(state.following / state.amplitudes - 1) <= LARGEST_CORRECTION):
                break
        return state
    return jax.lax.fori_loop(0, iterations + 1, closer, state)


def recursion(xp: Any, mesh: Mesh, exponent: Any, shift: Any, first: Any) -> Any:
    """Solve ``y[n+1] = exp(exponent[n]) y[n] + shift[n]`` along the last axis."""
    exponent, shift = xp.where(mesh.real, exponent, 0.0), xp.where(mesh.real, shift, 0.0)
    before = sum_before(xp, exponent)
    return xp.exp(before) * (xp.asarray(first)[..., None] + sum_before(xp, shift * xp.exp(-before - exponent)))


def sum_before(xp: Any, values: Any) -> Any:
    """Return sums over all earlier half-cycles, along the last axis.

    They are NaN after a half-cycle that is not finite; those before it are not affected. A product with a triangular
    matrix compiles faster than a cumulative sum.
    """
    earlier, finite = xp.tri(values.shape[-1], k=-1).T, xp.isfinite(values)
    sums = xp.where(finite, values, 0.0) @ earlier
    return xp.where((~finite).astype(float) @ earlier > 0, xp.nan, sums)
