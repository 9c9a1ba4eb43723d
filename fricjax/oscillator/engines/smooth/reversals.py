"""Reversals and stop of a motion, recorded during integration.

They must not depend on the requested samples, so the solver checks each step. If the velocity changes sign, the quintic
through both ends of the step gives the reversal. A contact that holds the mass acts as a stiff spring, on which the
mass vibrates; these oscillations are not half-cycles.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..nodes import quintic
from .scaled import Scaled
from .switching import AbstractWrapper

# An oscillation with a shorter duration, relative to the half-period of the spring, is one of the contact.
_ABRUPT = 0.75
# Newton steps on the quintic, starting from the secant of the velocities.
_NEWTON_STEPS = 3


class Log(NamedTuple):
    """Record of a motion up to a step, scaled.

    Attributes:
        points: positions of the start and of the ends of the half-cycles, padded with NaN.
        count: number of half-cycles.
        ended: time at which the last half-cycle ended, zero for none.
        last_reversal: time and position of the last reversal, of a half-cycle or of a vibrating contact.
        sticking: time since which the contact has held the mass, inf while it slides.
        still: time since which its vibration has also been invisible, inf before.
    """

    points: Float[Array, " points"]
    count: Int[Array, ""]
    ended: Float[Array, ""]
    last_reversal: tuple[Float[Array, ""], Float[Array, ""]]
    sticking: Float[Array, ""]
    still: Float[Array, ""]


def first_log(x: Array, v: Array, capacity: int) -> Log:
    """Return the log at the start of a motion.

    A half-cycle in progress counts as begun long ago.
    """
    begun = jnp.where(v == 0, 0.0, -jnp.inf)
    points, never = jnp.full(capacity + 1, jnp.nan).at[0].set(x), jnp.asarray(jnp.inf)
    return Log(points, jnp.zeros((), int), jnp.zeros(()), (begun, x), never, never)


def bending(machine: Scaled) -> Array:
    """Return the elastic travel of a contact between both maximum forces.

    It is zero without an elastic contact.
    """
    stiffness = machine.contact_stiffness
    bends = stiffness > 0
    return jnp.where(bends, 2 * machine.hold / jnp.where(bends, stiffness, 1.0), 0.0) / machine.length


def _rings(machine: Scaled, length: Array, duration: Array) -> Array:
    """Return True for an oscillation of a contact that holds the mass.

    An oscillation within the elastic travel of the contact involves no sliding. The exception is a contact so soft that
    the mass oscillates on the main spring. Released at its maximum force, a contact overshoots by up to twice that
    travel.
    """
    bends = bending(machine)
    half_period = jnp.pi / jnp.sqrt(1 + machine.contact_stiffness / machine.oscillator.stiffness)
    stiff = half_period < _ABRUPT * jnp.pi
    return ((length <= bends) & stiff) | ((length <= 2 * bends) & (duration < _ABRUPT * jnp.pi))


def after_step(log: Log, machine: Scaled, shows: Array, before: tuple, behind: tuple) -> Log:
    """Update the log after a step.

    Args:
        log: the log before the step.
        machine: the scaled oscillator.
        shows: scaled distance above which the vibration of a contact is visible.
        before: time, displacement, velocity, acceleration and internal states at the start of the step.
        behind: the same at its end.
    """
    t0, x0, v0, a0, _ = before
    t1, x1, v1, a1, states = behind
    reverses = v0 * v1 < 0
    h = jnp.where(reverses, t1 - t0, 1.0)
    velocity: Callable[[Array], Array] = lambda u: quintic(u, h, (x0, v0, a0), (x1, v1, a1))[1]
    u = v0 / jnp.where(reverses, v0 - v1, 1.0)
    for _ in range(_NEWTON_STEPS):
        v, slope = jax.jvp(velocity, (u,), (jnp.ones(()),))
        u = jnp.clip(u - v / jnp.where(slope == 0, 1.0, slope), 0.0, 1.0)
    t, x = t0 + u * h, quintic(u, h, (x0, v0, a0), (x1, v1, a1))[0]
    counts = reverses & ~_rings(machine, jnp.abs(x - log.last_reversal[1]), t - log.last_reversal[0])
    count = log.count + counts
    points = log.points.at[jnp.where(counts, count, log.points.size)].set(x, mode="drop")
    last_reversal = (jnp.where(reverses, t, log.last_reversal[0]), jnp.where(reverses, x, log.last_reversal[1]))
    within = jnp.minimum(bending(machine), machine.band)
    way = machine.settling(x1, v1, states)[1] if states else jnp.asarray(jnp.inf)
    sticking, still = (
        jnp.where(way <= most, jnp.minimum(since, t1), jnp.inf)
        for since, most in ((log.sticking, within), (log.still, jnp.minimum(shows, within)))
    )
    return Log(points, count, jnp.where(counts, t, log.ended), last_reversal, sticking, still)


def last_log(log: Log, machine: Scaled, x: Array) -> Log:
    """Complete the log at the end of a motion at `x`.

    A final half-cycle that creeps to rest without a reversal counts too.
    """
    stops = jnp.isfinite(log.sticking)
    counts = stops & (jnp.abs(x - log.last_reversal[1]) > 2 * bending(machine))
    count = log.count + counts
    points = log.points.at[jnp.where(counts, count, log.points.size)].set(x, mode="drop")
    ended = jnp.where(counts, log.sticking, log.ended)
    return log._replace(points=points, count=count, ended=jnp.where(stops, ended, jnp.inf))


class ReversalRecorder(AbstractWrapper):
    """Solver that records reversals.

    Attributes:
        solver: the solver that makes the steps.
        capacity: maximum number of half-cycles.
        record: function of the log, time and state at both ends of a step, and the arguments of the vector field;
            returns the updated log.
    """

    solver: Any
    capacity: int = eqx.field(static=True)
    record: Callable[[Log, tuple, tuple, Any], Log] = eqx.field(static=True)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Any:
        return self.solver.init(terms, t0, t1, y0, args), first_log(y0[0], y0[1], self.capacity)

    def step(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Any, made_jump: Any) -> Any:
        inner, log = solver_state
        y1, error, dense, inner, result = self.solver.step(terms, t0, t1, y0, args, inner, made_jump)
        return y1, error, dense, (inner, self.record(log, (t0, y0), (t1, y1), args)), result
