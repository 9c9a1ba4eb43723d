"""Single half-cycles, integrated over phase between turning points."""

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
    """Reversal between two half-cycles.

    Attributes:
        turning_point, time: position [m] and time [s] of the reversal.
        count: number of half-cycles so far.
        finished: whether no further half-cycle follows.
        resolved: False if the next half-cycle was tried but its phase does not advance to the end.
    """

    turning_point: Array
    time: Array
    count: Array
    finished: Array
    resolved: Array

    @property
    def at_rest(self) -> Array:
        """True if the motion ends here."""
        return self.finished & self.resolved


class HalfCycle(NamedTuple):
    """Nodes of a half-cycle in SI units: time, displacement, velocity, acceleration."""

    t: Array
    x: Array
    v: Array
    a: Array


# Map a turning point and the number of half-cycles before it to whether the mass rests there.
RestCondition = Callable[[Array, Array], Array]
# Result of trying a half-cycle: its nodes, the next turning point, and whether the phase resolves it.
Attempt = tuple[HalfCycle, Array, Array]


class Entry(NamedTuple):
    """Start within a half-cycle: frame, phase, and whether the mass moves."""

    frame: Frame
    theta: Array
    moving: Array


def enter(oscillator: Oscillator, start: Start) -> Entry:
    """Return frame and phase of a start.

    The phase of a start from rest is unused.
    """
    moving = start.v0 != 0
    side = jax.lax.stop_gradient(jnp.where(moving, -jnp.sign(start.v0), jnp.where(start.x0 < 0, -1.0, 1.0)))
    frame = frame_at(oscillator, side, start.x0)
    offset = amplitude_at(oscillator, frame, start.x0)
    lag = jnp.where(moving, -side * start.v0, 1.0) / frame.angular_frequency
    return Entry(frame, jnp.arctan2(lag, offset), moving)


def half_cycle_by_steps(
    oscillator: Oscillator, start: Start, entry: Entry, fractions: Float[Array, " nodes"], inside: Any, at: Reversal
) -> Attempt:
    """Integrate the half-cycle from a reversal or from a moving start.

    The latter if `inside` is True.
    """
    y = at.turning_point
    side = jnp.where(inside, entry.frame.side, side_of(y))
    frame = frame_at(oscillator, side, jnp.where(inside, start.x0, y))
    offset, lag = amplitude_at(oscillator, frame, y), start.v0 / frame.angular_frequency
    # The inner choice avoids the infinite derivative of the root at zero amplitude.
    amplitude = jnp.where(inside, jnp.sqrt(jnp.where(inside, offset**2 + lag**2, 1.0)), offset)
    begin = jnp.where(inside, entry.theta, 0.0)
    passing = None
    if oscillator.restoring.hysteretic:
        # A node must lie on the kink at the equilibrium; a first integration shows its phase.
        first = integrate_phase(oscillator, frame, amplitude, phases(frame, amplitude, begin, fractions))[0]
        passing = jax.lax.stop_gradient(first[fractions.size // 2])
    theta = phases(frame, passing, begin, fractions)
    motion = integrate_phase(oscillator, frame, amplitude, theta)
    return _attempt(oscillator, frame, Angle.of(theta), *motion, at.time)


def half_cycle_by_collocation(oscillator: Oscillator, panels: Panels, at: Reversal) -> Attempt:
    """Integrate the half-cycle from a reversal by collocation.

    The motion is the same, with cheaper derivatives.
    """
    side = side_of(at.turning_point)
    frame = frame_at(oscillator, side, at.turning_point)
    amplitude = amplitude_at(oscillator, frame, at.turning_point)
    motion = collocate(oscillator, frame, amplitude, panels)
    return _attempt(oscillator, frame, Angle.of(jnp.pi * panels.fractions), *motion, at.time)


def _attempt(
    oscillator: Oscillator, frame: Frame, angle: Angle, amplitudes: Array, elapsed: Array, time: Array
) -> Attempt:
    nodes = HalfCycle(time + elapsed, *motion_at(oscillator, frame, amplitudes, angle))
    # A fit may prescribe a half-cycle although friction would hold the mass; it exists in phase only.
    forced = oscillator.friction.set_valued & (amplitudes[0] <= 0)
    resolved = forced | is_resolved(oscillator, frame, amplitudes, angle)
    return nodes, reversal_position(oscillator, frame, amplitudes[-1]), resolved


def advance(
    at: Reversal, half_cycle: HalfCycle, turning_point: Array, resolved: Any, rests: RestCondition
) -> tuple[Reversal, tuple[HalfCycle, Array]]:
    """Return the reversal after a half-cycle, its nodes and its turning point.

    If the motion is finished or the half-cycle is not resolved, the mass stays, and the turning point is NaN.
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
