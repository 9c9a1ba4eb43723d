"""Interpolation of half-cycles in a table over their amplitude.

Half-cycles of one law differ only in their starting turning point, and they depend smoothly on it. A few amplitudes are
integrated in parallel, at Chebyshev points in the logarithm of the distance between turning point and dead band. (For
a pendulum the coordinate is also unbounded towards the top.) Every half-cycle of a long decay is interpolated between
them. The interpolated quantities are ratios to the undisturbed oscillation of the frame, which vary little.
"""

from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ...oscillator import Oscillator
from ...restoring import Pendulum
from ..base import Demands
from .collocation import Panels, collocate
from .frame import Angle, Frame, frame_at, is_resolved, motion_at, reference_force, reversal_position, side_of
from .half_cycles import HalfCycle, RestCondition, Reversal, advance

# Largest distance from the centre of a table relative to its reach.
_OUTSIDE = 1.05


class Span(NamedTuple):
    """Range of turning points in a table [m], as distances from equilibrium.

    The table extends beyond `highest` by `margin`, a part of its length. It does not extend below `lowest`, where the
    phase may leap.
    """

    lowest: Array | np.ndarray
    highest: Array | np.ndarray
    margin: Any = 0.0


class AmplitudeTable(NamedTuple):
    """Amplitude ratio and undisturbed phase at the nodes of a half-cycle.

    Both are Chebyshev coefficients in the logarithmic amplitude, shape (degree + 1, nodes).
    """

    angle: Angle
    amplitude: Array | np.ndarray
    phase: Array | np.ndarray
    centre: Array
    reach: Array


def _chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev points in [-1, 1] and the value-to-coefficient matrix."""
    rank = np.arange(count)
    points = np.cos(np.pi * rank / (count - 1))
    weight = np.where((rank == 0) | (rank == count - 1), 0.5, 1.0)
    cosines = np.cos(np.pi * np.outer(rank, rank) / (count - 1))
    return points, 2.0 / (count - 1) * weight[:, None] * cosines * weight[None, :]


def _polynomials(at: Array, count: int) -> Array:
    """Evaluate the Chebyshev polynomials T_0 ... T_{count-1}, stacked along a last axis.

    The recurrence also works outside [-1, 1].
    """

    def next_one(two: tuple[Array, Array], _: Any) -> tuple[tuple[Array, Array], Array]:
        this, following = two
        return (following, 2 * at * following - this), this

    terms = jax.lax.scan(next_one, (jnp.ones_like(at), at), length=count)[1]
    return jnp.moveaxis(terms, 0, -1)


def _place(oscillator: Oscillator, centre: Array, reach: Array, deflection: Array) -> Array:
    """Return the position of a turning point in the table, clipped.

    Trial values with a fast decay, and amplitudes beyond the end of a record, lie outside the table. Clipping keeps
    them finite; they do not affect the result.
    """
    spring = oscillator.restoring
    excess = spring.steepened(deflection) - reference_force(oscillator) / oscillator.stiffness
    ends = spring.gathered(centre - _OUTSIDE * reach), spring.gathered(centre + _OUTSIDE * reach)
    return (spring.spread(jnp.clip(excess, *ends)) - centre) / reach


def _start(oscillator: Oscillator, frame: Frame, deflection: Array) -> Array:
    """Return the initial amplitude of half-cycles from these deflections."""
    return oscillator.restoring.stretched(deflection) - frame.dead_band


def make_table(oscillator: Oscillator, span: Span, count: int, panels: Panels) -> AmplitudeTable:
    """Integrate `count` amplitudes in parallel."""
    band = reference_force(oscillator) / oscillator.stiffness
    between = oscillator.restoring.steepened(jnp.stack([span.lowest, span.highest]))
    ends = jax.lax.stop_gradient(oscillator.restoring.spread(between - band))
    reach = (1 + span.margin) * (ends[1] - ends[0]) / 2
    centre = ends[0] + reach
    points, transform = _chebyshev(count)
    deflection = oscillator.restoring.unsteepened(band + oscillator.restoring.gathered(centre + reach * points))
    frame = frame_at(oscillator, jnp.ones(count), deflection)
    start = _start(oscillator, frame, deflection)
    amplitudes, elapsed = collocate(oscillator, frame, start, panels)
    ratio, phase = amplitudes / start, elapsed * frame.angular_frequency
    return AmplitudeTable(Angle.of(jnp.pi * panels.fractions), transform @ ratio.T, transform @ phase.T, centre, reach)


def half_cycles_from_table(
    oscillator: Oscillator, table: AmplitudeTable, begin: Reversal, rests: RestCondition, capacity: int
) -> tuple[Reversal, tuple[HalfCycle, Array]]:
    """Interpolate all half-cycles from a reversal on.

    The loop carries only the state of the reversals; all nodes are interpolated together afterwards.

    Returns:
        The last reversal; the nodes of the half-cycles, shape (capacity, nodes), and their next turning points.
    """
    count = table.amplitude.shape[0]

    def at(deflection: Array) -> Array:
        return _polynomials(_place(oscillator, table.centre, table.reach, deflection), count)

    def step(now: Reversal, _: Any) -> tuple[Reversal, tuple[Reversal, Array]]:
        deflection = jnp.abs(now.turning_point)
        frame = frame_at(oscillator, side_of(now.turning_point), deflection)
        weights = at(deflection)
        amplitude = _start(oscillator, frame, deflection) * (weights @ table.amplitude[:, -1])
        elapsed = weights @ table.phase[:, -1] / frame.angular_frequency
        following = reversal_position(oscillator, frame, amplitude)
        ends = HalfCycle(elapsed[None] + now.time, following[None], jnp.zeros(1), jnp.zeros(1))
        resolved = is_resolved(oscillator, frame, amplitude[None], table.angle.at(slice(-1, None)))
        after = advance(now, ends, following, resolved, rests)[0]
        return after, (now, after.count == now.count)

    end, (starts, stays) = jax.lax.scan(step, begin, length=capacity)
    deflection = jnp.abs(starts.turning_point)
    frame = frame_at(oscillator, side_of(starts.turning_point), deflection)
    weights = at(deflection)
    start = _start(oscillator, frame, deflection)[:, None]
    columns = frame._replace(**{name: value[:, None] for name, value in frame._asdict().items()})
    motion = motion_at(oscillator, columns, start * (weights @ table.amplitude), table.angle.at(None))
    read = HalfCycle(starts.time[:, None] + weights @ table.phase / columns.angular_frequency, *motion)
    resting = stays[:, None]
    still = HalfCycle(starts.time[:, None], starts.turning_point[:, None], jnp.zeros((1, 1)), jnp.zeros((1, 1)))
    nodes = HalfCycle(*(jnp.where(resting, rest, value) for rest, value in zip(still, read, strict=True)))
    points = jnp.concatenate([starts.turning_point[1:], end.turning_point[None]])
    return end, (nodes, jnp.where(stays, jnp.nan, points))


# Minimum number of half-cycles for a table, and table entries per e-fold of amplitude for an error of 1e-2 nm on 2 mm.
# The number depends on the sector of the complex plane in which the motion is analytic: a quarter turn about the dead
# band or for a tanh of the speed, half of that for the Gaussian of the speed in a velocity-weakening law.
_FEW, _PER_E_FOLD, _PER_E_FOLD_FALLING = 8, 5.0, 9.0
# Entries per unit of the coordinate of a pendulum, for a drift of 1e-7 rad over a hundred half-cycles from 3.1 rad.
_PER_UNIT = 11.0
# Extension of a table beyond the largest deflection, in the coordinate that is unbounded at the top of a pendulum.
_BEYOND = 1.1
# Table sizes; velocity-weakening laws use the larger one, which most of their records need. Each size is compiled
# separately, in seconds. A smaller table saves only a few per cent of a fit, since entries are solved in parallel:
# `python experiments/benchmarks/cold.py`.
_SIZES = (24, 48)


def table_for(oscillator: Oscillator, demands: Demands) -> tuple[Span, int] | None:
    """Return range and size of a table for a fit, else None.

    A table requires motions from rest. It has one mesh for all amplitudes, so it cannot follow the kink of a hysteretic
    spring, which moves with the amplitude.
    """
    starts = demands.deflections
    if not demands.from_rest or oscillator.restoring.hysteretic or any(each.size < _FEW for each in starts):
        return None
    band, spring = float(oscillator.dead_band), cast("Any", oscillator.restoring)
    least, highest = min(float(each.min()) for each in starts), max(float(each.max()) for each in starts)
    # Near the dead band, where the phase leaps, the margin is small.
    lowest = least - 0.2 * max(least - band, 0.0)
    # With a wrong offset a reading may exceed the largest deflection.
    ratio = spring.steepened(np.float64(min(highest, spring.largest)))
    highest = spring.unsteepened(np.float64(_BEYOND * float(ratio)))
    span = Span(np.asarray(lowest), np.asarray(highest), np.asarray(0.0))
    ends = [float(spring.steepened(np.float64(end))) for end in (span.lowest, span.highest)]
    low, high = (float(spring.spread(np.float64(end))) for end in (max(ends[0] - band, 0.1 * ends[0]), ends[1]))
    falls = oscillator.friction.set_valued and bool(np.isfinite(float(oscillator.friction.velocity_scale())))
    density = _PER_UNIT if isinstance(spring, Pendulum) else _PER_E_FOLD_FALLING if falls else _PER_E_FOLD
    needed = density * (high - low)
    return span, next((size for size in _SIZES if size >= needed and not falls), _SIZES[-1])
