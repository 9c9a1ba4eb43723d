"""Steps in time of a mass under set-valued friction and an outside force, with reversals and slips located.

Sliding has a direction, and within it the equation of motion is smooth. Where a step carries the velocity through zero
it is taken again up to that very instant. There the mass is held if the net pull does not exceed the static friction
force, and slides on in the direction of the pull if it does. A mass at rest is held until the pull outgrows that force,
which is located as well. So no step straddles the jump of the friction force.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ...friction.base import Scalar
from ..drive import ExponentialRelease
from ..oscillator import Oscillator

# Slides and rests in one step; more would be chatter, which ends as rest.
_PHASES = 8
# Iterations of false position; each keeps a bracket, so that more could only sharpen the root.
_ROOT_ITERATIONS = 12


class State(NamedTuple):
    """Displacement [m], velocity [m/s], direction of sliding (+1, -1, or 0 at rest), and whether it has slid yet."""

    x: Scalar
    v: Scalar
    direction: Scalar
    slid: Array


class Machine(eqx.Module):
    """An oscillator with the force that held it before release [N] and the law by which this force decays."""

    oscillator: Oscillator
    hold: Scalar
    release: ExponentialRelease | None


class Floor(NamedTuple):
    """Floor acceleration between two samples: a straight line from `value` [m/s^2] at `since` [s]."""

    since: Scalar
    value: Scalar
    slope: Scalar


def pull(machine: Machine, floor: Floor, t: Scalar, x: Scalar) -> Scalar:
    """Net force towards negative x that friction has to balance at rest [N]."""
    oscillator = machine.oscillator
    shaking = oscillator.mass * (floor.value + floor.slope * (t - floor.since))
    holding = 0.0 if machine.release is None else machine.release.force(t, machine.hold)
    return oscillator.restoring_force(x) + shaking - holding


def holding_force(machine: Machine, x: Scalar, slid: Array) -> Scalar:
    """Largest force that holds the mass at rest [N]; before it has slid that of a contact that has stood."""
    law, load = machine.oscillator.friction, machine.oscillator.normal_force
    contact = jnp.where(slid, law.static_force(load), law.breakaway_force(load))
    return contact + machine.oscillator.hysteresis(x)


def direction_from_rest(machine: Machine, floor: Floor, t: Scalar, x: Scalar, slid: Array) -> Scalar:
    """Where a mass of zero velocity goes: 0 if static friction holds it."""
    force = pull(machine, floor, t, x)
    return jnp.where(jnp.abs(force) > holding_force(machine, x, slid), -jnp.sign(force), 0.0)


def advance(machine: Machine, floor: Floor, t: Scalar, step: Scalar, state: State) -> State:
    """The state after one step, through all the reversals, stops and slips in it."""

    def unfinished(carry: tuple[State, Scalar, Array]) -> Array:
        _, left, phases = carry
        return jnp.logical_and(left > 0, phases < _PHASES)

    def phase(carry: tuple[State, Scalar, Array]) -> tuple[State, Scalar, Array]:
        now, left, phases = carry
        after, used = jax.lax.cond(now.direction == 0, _rest, _slide, machine, floor, t + step - left, left, now)
        return after, left - used, phases + 1

    return jax.lax.while_loop(unfinished, phase, (state, step, jnp.zeros((), int)))[0]


def _slide(machine: Machine, floor: Floor, t: Scalar, step: Scalar, state: State) -> tuple[State, Scalar]:
    """Slide for `step`, or up to the instant of zero velocity; and the time used."""
    end = _runge_kutta(machine, floor, t, step, state)

    def turn() -> tuple[State, Scalar]:
        used = _time_of_turn(machine, floor, t, step, state)
        x = _runge_kutta(machine, floor, t, used, state).x
        onward = direction_from_rest(machine, floor, t + used, x, jnp.asarray(True))
        stuck = (used == 0) & (onward == state.direction)
        return State(x, jnp.zeros(()), jnp.where(stuck, 0.0, onward), jnp.asarray(True)), used

    return jax.lax.cond(state.direction * end.v < 0, turn, lambda: (end, step))


def _time_of_turn(machine: Machine, floor: Floor, t: Scalar, step: Scalar, state: State) -> Scalar:
    """Time until the velocity vanishes, known to do so within `step`; 0 where the slide does not even begin."""
    at_start = state.v == 0
    onset = _acceleration(machine, floor, state.direction, t, state.x, state.v)

    def forward(tau: Scalar) -> Scalar:
        # From rest the mean acceleration is followed instead, for the velocity also vanishes at the start.
        v = state.direction * _runge_kutta(machine, floor, t, tau, state).v
        return v / jnp.where(at_start, jnp.maximum(tau, jnp.finfo(float).tiny), 1.0)

    begin = state.direction * jnp.where(at_start, onset, state.v)
    return jnp.where(begin > 0, _root(forward, step, begin, forward(step)), 0.0)


def _rest(machine: Machine, floor: Floor, t: Scalar, step: Scalar, state: State) -> tuple[State, Scalar]:
    """Rest for `step`, or up to the instant at which the pull outgrows static friction; and the time used."""
    static = holding_force(machine, state.x, state.slid)
    excess = lambda tau: jnp.abs(pull(machine, floor, t + tau, state.x)) - static

    def slip() -> tuple[State, Scalar]:
        used = _root(excess, step, jnp.minimum(excess(jnp.zeros(())), 0.0), excess(step))
        return State(
            state.x, jnp.zeros(()), -jnp.sign(pull(machine, floor, t + step, state.x)), jnp.asarray(True)
        ), used

    return jax.lax.cond(excess(step) > 0, slip, lambda: (state, step))


def _acceleration(machine: Machine, floor: Floor, direction: Scalar, t: Scalar, x: Scalar, v: Scalar) -> Scalar:
    """Acceleration of the mass that slides in this direction [m/s^2]."""
    oscillator = machine.oscillator
    friction = oscillator.friction.sliding_force(jnp.maximum(direction * v, 0.0), oscillator.normal_force)
    resisting = oscillator.dissipation(v) + direction * (friction + oscillator.hysteresis(x))
    return -(pull(machine, floor, t, x) + resisting) / oscillator.mass


def _runge_kutta(machine: Machine, floor: Floor, t: Scalar, h: Scalar, state: State) -> State:
    """One classical step of order four with the direction of sliding held."""
    x, v, direction, slid = state
    a1 = _acceleration(machine, floor, direction, t, x, v)
    v2 = v + h / 2 * a1
    a2 = _acceleration(machine, floor, direction, t + h / 2, x + h / 2 * v, v2)
    v3 = v + h / 2 * a2
    a3 = _acceleration(machine, floor, direction, t + h / 2, x + h / 2 * v2, v3)
    v4 = v + h * a3
    a4 = _acceleration(machine, floor, direction, t + h, x + h * v3, v4)
    return State(x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4), direction, slid)


def _root(f: Callable[[Scalar], Scalar], end: Scalar, f_begin: Scalar, f_end: Scalar) -> Scalar:
    """Where `f` vanishes between 0 and `end`: false position, with a halving that keeps it from stalling (Illinois)."""

    def improve(_: Array, bracket: tuple) -> tuple:
        a, fa, b, fb, _ = bracket
        c = jnp.where(fb == fa, b, (a * fb - b * fa) / jnp.where(fb == fa, 1.0, fb - fa))
        fc = f(c)
        crossed = fc * fb < 0
        return jnp.where(crossed, b, a), jnp.where(crossed, fb, fa / 2), c, fc, c

    return jax.lax.fori_loop(0, _ROOT_ITERATIONS, improve, (jnp.zeros(()), f_begin, end, f_end, end))[4]
