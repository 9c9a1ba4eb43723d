"""Half-cycles one after the other, each integrated over its phase from turning point to turning point."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...motion import Start
from ...oscillator import Oscillator
from .collocation import Panels, collocate
from .frame import Angle, Frame, amplitude_at, frame_at, is_resolved, motion_at, reversal_position, side_of
from .phase_steps import integrate_phase, phases


class Reversal(NamedTuple):
    """Where one half-cycle ends and the next one begins.

    Attributes:
        turning_point, time: where and when the mass stands still [m], [s].
        count: number of half-cycles so far.
        finished: whether no further one is to be made from here.
        resolved: False where the next one has been tried and its phase does not run on to its end.
    """

    turning_point: Array
    time: Array
    count: Array
    finished: Array
    resolved: Array

    @property
    def at_rest(self) -> Array:
        """Whether the motion ends here."""
        return self.finished & self.resolved


class HalfCycle(NamedTuple):
    """Nodes of a half-cycle: time [s], displacement [m], velocity [m/s], acceleration [m/s^2]."""

    t: Array
    x: Array
    v: Array
    a: Array


# From a turning point and the number of half-cycles before it to whether the mass stays there.
RestCondition = Callable[[Array, Array], Array]
# A half-cycle that has been tried: its nodes, its next turning point, and whether the phase resolves it.
Attempt = tuple[HalfCycle, Array, Array]


class Entry(NamedTuple):
    """A start inside a half-cycle: its side, frame and phase, and whether the mass moves at all at the start."""

    frame: Frame
    theta: Array
    moving: Array


def enter(oscillator: Oscillator, start: Start) -> Entry:
    """Frame and phase of a start; the phase is unused for a start from rest."""
    moving = start.v0 != 0
    side = jax.lax.stop_gradient(jnp.where(moving, -jnp.sign(start.v0), jnp.where(start.x0 < 0, -1.0, 1.0)))
    frame = frame_at(oscillator, side, start.x0)
    offset = amplitude_at(oscillator, frame, start.x0)
    lag = jnp.where(moving, -side * start.v0, 1.0) / frame.angular_frequency
    return Entry(frame, jnp.arctan2(lag, offset), moving)


def half_cycle_by_steps(
    oscillator: Oscillator, start: Start, entry: Entry, fractions: Float[Array, " nodes"], inside: Any, at: Reversal
) -> Attempt:
    """The half-cycle from a reversal or, where `inside` holds, from a start in motion."""
    y = at.turning_point
    side = jnp.where(inside, entry.frame.side, side_of(y))
    frame = frame_at(oscillator, side, jnp.where(inside, start.x0, y))
    offset, lag = amplitude_at(oscillator, frame, y), start.v0 / frame.angular_frequency
    # The inner choice keeps the derivative of the root from an amplitude of zero, which is infinite.
    amplitude = jnp.where(inside, jnp.sqrt(jnp.where(inside, offset**2 + lag**2, 1.0)), offset)
    begin = jnp.where(inside, entry.theta, 0.0)
    passing = None
    if oscillator.restoring.hysteretic:
        # A node has to lie on the kink at the equilibrium, and only a first integration shows where that is passed.
        first = integrate_phase(oscillator, frame, amplitude, phases(frame, amplitude, begin, fractions))[0]
        passing = jax.lax.stop_gradient(first[fractions.size // 2])
    theta = phases(frame, passing, begin, fractions)
    motion = integrate_phase(oscillator, frame, amplitude, theta)
    return _attempt(oscillator, frame, Angle.of(theta), *motion, at.time)


def half_cycle_by_collocation(oscillator: Oscillator, panels: Panels, at: Reversal) -> Attempt:
    """The half-cycle from a reversal, by collocation: the same motion, with cheaper derivatives."""
    side = side_of(at.turning_point)
    frame = frame_at(oscillator, side, at.turning_point)
    amplitude = amplitude_at(oscillator, frame, at.turning_point)
    motion = collocate(oscillator, frame, amplitude, panels)
    return _attempt(oscillator, frame, Angle.of(jnp.pi * panels.fractions), *motion, at.time)


def _attempt(
    oscillator: Oscillator, frame: Frame, angle: Angle, amplitudes: Array, elapsed: Array, time: Array
) -> Attempt:
    nodes = HalfCycle(time + elapsed, *motion_at(oscillator, frame, amplitudes, angle))
    # A half-cycle that a record asks for where friction would hold the mass exists in phase only.
    forced = oscillator.friction.set_valued & (amplitudes[0] <= 0)
    resolved = forced | is_resolved(oscillator, frame, amplitudes, angle)
    return nodes, reversal_position(oscillator, frame, amplitudes[-1]), resolved


def advance(
    at: Reversal, half_cycle: HalfCycle, turning_point: Array, resolved: Any, rests: RestCondition
) -> tuple[Reversal, tuple[HalfCycle, Array]]:
    """The reversal behind a half-cycle that has been tried, its nodes, and its turning point.

    All stay where they are if it is not to be, or cannot be; the turning point is NaN then.
    """
    resolved = at.resolved & (at.finished | resolved)
    stays = at.finished | ~resolved
    nodes = HalfCycle(
        jnp.where(stays, at.time, half_cycle.t),
        jnp.where(stays, at.turning_point, half_cycle.x),
        jnp.where(stays, 0.0, half_cycle.v),
        jnp.where(stays, 0.0, half_cycle.a),
    )
    y, count = jnp.where(stays, at.turning_point, turning_point), at.count + jnp.where(stays, 0, 1)
    after = Reversal(y, nodes.t[-1], count, stays | rests(y, count), resolved)
    return after, (nodes, jnp.where(count == at.count, jnp.nan, y))
