"""Half-cycles one after the other, each integrated over its phase from turning point to turning point."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...motion import Start
from ...oscillator import Oscillator
from .collocation import Panels, collocate
from .frame import Angle, Frame, amplitude_at, frame_at, is_resolved, motion_at, phases, turned_at
from .phase_steps import integrate_phase


class Standstill(NamedTuple):
    """Between two half-cycles.

    Attributes:
        turning_point, time: where the mass stands still [m], [s].
        count: number of half-cycles so far.
        finished: whether no further one is to be made from here.
        carried: False where the next one has been tried and its phase would not carry it.
    """

    turning_point: Array
    time: Array
    count: Array
    finished: Array
    carried: Array

    @property
    def at_rest(self) -> Array:
        """Whether the motion ends here."""
        return self.finished & self.carried


class Stroke(NamedTuple):
    """Nodes of a half-cycle: time [s], displacement [m], velocity [m/s], acceleration [m/s^2]."""

    t: Array
    x: Array
    v: Array
    a: Array


Rests = Callable[[Array, Array], Array]


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


class Reached(NamedTuple):
    """A half-cycle that has been tried: its nodes, its next turning point, and whether its phase carried it there."""

    stroke: Stroke
    turned: Array
    carried: Array


def stroke_from(
    oscillator: Oscillator, start: Start, entry: Entry, fractions: Float[Array, " nodes"], inside: Any, at: Standstill
) -> Reached:
    """The half-cycle from a standstill or, where `inside` holds, from a start in motion."""
    y = at.turning_point
    side = jnp.where(inside, entry.frame.side, _side(y))
    frame = frame_at(oscillator, side, jnp.where(inside, start.x0, y))
    offset, lag = amplitude_at(oscillator, frame, y), start.v0 / frame.angular_frequency
    amplitude = jnp.where(inside, jnp.sqrt(jnp.where(inside, offset**2 + lag**2, 1.0)), offset)
    begin = jnp.where(inside, entry.theta, 0.0)
    theta = phases(frame, _passing(oscillator, frame, amplitude, begin, fractions), begin, fractions)
    motion = integrate_phase(oscillator, frame, amplitude, theta)
    return _reached(oscillator, frame, Angle.of(theta), *motion, at.time)


def collocated_stroke(oscillator: Oscillator, panels: Panels, at: Standstill) -> Reached:
    """The half-cycle from a standstill, by collocation: the same motion, with cheaper derivatives."""
    side = _side(at.turning_point)
    frame = frame_at(oscillator, side, at.turning_point)
    amplitude = amplitude_at(oscillator, frame, at.turning_point)
    motion = collocate(oscillator, frame, amplitude, panels)
    return _reached(oscillator, frame, Angle.of(jnp.pi * panels.fractions), *motion, at.time)


def _side(turning_point: Array) -> Array:
    return jnp.where(turning_point < 0, -1.0, 1.0)


def _reached(
    oscillator: Oscillator, frame: Frame, angle: Angle, amplitudes: Array, elapsed: Array, time: Array
) -> Reached:
    nodes = Stroke(time + elapsed, *motion_at(oscillator, frame, amplitudes, angle))
    # A half-cycle that a record asks for where friction would hold the mass exists in phase only.
    forced = oscillator.friction.set_valued & (amplitudes[0] <= 0)
    carried = forced | is_resolved(oscillator, frame, amplitudes, angle)
    return Reached(nodes, turned_at(oscillator, frame, amplitudes[-1]), carried)


def _passing(oscillator: Oscillator, frame: Frame, amplitude: Array, begin: Array, fractions: Array) -> Array | None:
    """Amplitude with which the mass passes the kink of a hysteretic spring; None for a spring without."""
    if not oscillator.restoring.hysteretic:
        return None
    first = integrate_phase(oscillator, frame, amplitude, phases(frame, amplitude, begin, fractions))[0]
    return jax.lax.stop_gradient(first[fractions.size // 2])


def advance(at: Standstill, stroke: Stroke, turned: Array, carried: Any, rests: Rests) -> tuple[Standstill, Stroke]:
    """The standstill after a half-cycle, and its nodes; both stay where they are if it is not to be, or cannot be."""
    carried = at.carried & (at.finished | carried)
    stays = at.finished | ~carried
    kept = Stroke(
        jnp.where(stays, at.time, stroke.t),
        jnp.where(stays, at.turning_point, stroke.x),
        jnp.where(stays, 0.0, stroke.v),
        jnp.where(stays, 0.0, stroke.a),
    )
    y, count = jnp.where(stays, at.turning_point, turned), at.count + jnp.where(stays, 0, 1)
    return Standstill(y, kept.t[-1], count, stays | rests(y, count), carried), kept
