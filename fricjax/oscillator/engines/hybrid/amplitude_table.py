"""Half-cycles read off a table over their amplitude.

Half-cycles of one law differ only in the turning point from which they start, and they change smoothly with it. So a
few amplitudes are integrated side by side, at Chebyshev points in the logarithm of the distance between turning point
and dead band (for a pendulum in a coordinate that has no bound towards the top either), and every half-cycle of a long
decay is interpolated between them: what was a loop over all of them becomes one over the steps of a single one.
Interpolated are the ratios to the undisturbed swing of its frame, which
change little.
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

# Distance from the centre of a table to where it is left, over its reach.
_OUTSIDE = 1.05


class Span(NamedTuple):
    """Range of turning points for which a table is made [m], as distances from the equilibrium.

    It goes beyond the highest by a `margin`, a part of its length; below the lowest the phase may leap.
    """

    lowest: Array | np.ndarray
    highest: Array | np.ndarray
    margin: Any = 0.0


class AmplitudeTable(NamedTuple):
    """Ratio of amplitude to its start, and phase of the undisturbed swing, at the nodes of the half-cycle.

    Both as Chebyshev coefficients in the logarithmic amplitude, shape (degree + 1, nodes).
    """

    angle: Angle
    amplitude: Array | np.ndarray
    phase: Array | np.ndarray
    centre: Array
    reach: Array


def _chebyshev(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the second kind in [-1, 1], and the matrix from values there to coefficients."""
    rank = np.arange(count)
    points = np.cos(np.pi * rank / (count - 1))
    weight = np.where((rank == 0) | (rank == count - 1), 0.5, 1.0)
    cosines = np.cos(np.pi * np.outer(rank, rank) / (count - 1))
    return points, 2.0 / (count - 1) * weight[:, None] * cosines * weight[None, :]


def _polynomials(at: Array, count: int) -> Array:
    """Chebyshev polynomials T_0 ... T_{count-1}, stacked along a last axis; by recurrence, so also outside [-1, 1]."""

    def next_one(two: tuple[Array, Array], _: Any) -> tuple[tuple[Array, Array], Array]:
        this, following = two
        return (following, 2 * at * following - this), this

    terms = jax.lax.scan(next_one, (jnp.ones_like(at), at), length=count)[1]
    return jnp.moveaxis(terms, 0, -1)


def _place(oscillator: Oscillator, centre: Array, reach: Array, deflection: Array) -> Array:
    """Place of a turning point in the table; all that lie well outside get the place of its end.

    So trial values under which the motion decays too fast still give one, and beyond the end of a record the amplitudes
    no longer matter, but must not end in a logarithm of zero.
    """
    spring = oscillator.restoring
    excess = spring.steepened(deflection) - reference_force(oscillator) / oscillator.stiffness
    ends = spring.gathered(centre - _OUTSIDE * reach), spring.gathered(centre + _OUTSIDE * reach)
    return (spring.spread(jnp.clip(excess, *ends)) - centre) / reach


def _start(oscillator: Oscillator, frame: Frame, deflection: Array) -> Array:
    """Amplitude at the start of half-cycles from these distances to the equilibrium."""
    return oscillator.restoring.stretched(deflection) - frame.dead_band


def make_table(oscillator: Oscillator, span: Span, count: int, panels: Panels) -> AmplitudeTable:
    """Integrate `count` amplitudes side by side."""
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
    """Half-cycles from a reversal on; their nodes, shape (capacity, nodes), and their next turning points.

    The loop over them carries only what the next one needs; all their nodes are read off the table behind it at once.
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


# Half-cycles from which a table over amplitude pays, and its entries per e-fold of amplitude for 1e-2 nm on 2 mm. The
# number goes with the angle in the complex plane over which the motion stays smooth: a quarter of a turn about the dead
# band or for a tanh of the speed, half of that for the Gaussian of the speed in a law that falls.
_FEW, _PER_E_FOLD, _PER_E_FOLD_FALLING = 8, 5.0, 9.0
# The same per unit of the coordinate of a pendulum, for 1e-7 rad of drift over a hundred half-cycles from 3.1 rad on.
_PER_UNIT = 11.0
# How far beyond the largest deflection a table reaches, in the coordinate that has no bound at the top of a pendulum.
_BEYOND = 1.1
# Sizes of a table; laws that fall take the larger one, which most of their records need. Each is compiled for itself,
# in seconds, and a third of the entries, which are solved side by side, saves no more than a few per cent of a fit:
# `python experiments/benchmarks/cold.py`.
_SIZES = (24, 48)


def table_for(oscillator: Oscillator, demands: Demands) -> tuple[Span, int] | None:
    """Range and number of entries of the table that the records of a fit ask for; None where it could serve nothing.

    A table is for motions from rest; it has one mesh for all amplitudes, and the kink of a hysteretic spring lies
    elsewhere at each.
    """
    starts = demands.deflections
    if not demands.from_rest or oscillator.restoring.hysteretic or any(each.size < _FEW for each in starts):
        return None
    band, spring = float(oscillator.dead_band), cast("Any", oscillator.restoring)
    least, highest = min(float(each.min()) for each in starts), max(float(each.max()) for each in starts)
    # Near the dead band, where the phase leaps, the margin is narrow.
    lowest = least - 0.2 * max(least - band, 0.0)
    # With a wrong offset a reading may lie beyond the top itself.
    ratio = spring.steepened(np.float64(min(highest, spring.largest)))
    highest = spring.unsteepened(np.float64(_BEYOND * float(ratio)))
    span = Span(np.asarray(lowest), np.asarray(highest), np.asarray(0.0))
    ends = [float(spring.steepened(np.float64(end))) for end in (span.lowest, span.highest)]
    low, high = (float(spring.spread(np.float64(end))) for end in (max(ends[0] - band, 0.1 * ends[0]), ends[1]))
    falls = oscillator.friction.set_valued and bool(np.isfinite(float(oscillator.friction.velocity_scale())))
    density = _PER_UNIT if isinstance(spring, Pendulum) else _PER_E_FOLD_FALLING if falls else _PER_E_FOLD
    needed = density * (high - low)
    return span, next((size for size in _SIZES if size >= needed and not falls), _SIZES[-1])
