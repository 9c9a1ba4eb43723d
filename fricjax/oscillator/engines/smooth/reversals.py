"""Reversals and stop of a motion, recorded while it is integrated.

They belong to the motion and not to the samples that someone asks for, so the solver itself looks at each step: where
the velocity changes sign, the quintic through both ends has the reversal. A contact that holds the mass is a stiff
spring, on which the mass rings on; such swings are no half-cycles.
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

# Duration of a swing, as a part of the half-period of the spring, below which the contact swings and not the spring.
_ABRUPT = 0.75
# Newton steps on the quintic, from where the secant of the velocities puts the reversal.
_NEWTON_STEPS = 3


class Log(NamedTuple):
    """What has been recorded up to a step, scaled.

    Attributes:
        points: positions of the start and of the ends of the half-cycles, NaN behind them. count: number of
        half-cycles; `ended`: when the last of them ended, zero for none. last_reversal: time and position of the last
        reversal, be it of a half-cycle or of a ringing contact. sticking: since when the contact has held the mass, inf
        while it slides; `still`: since when, besides, nothing of
            its ringing shows.
    """

    points: Float[Array, " points"]
    count: Int[Array, ""]
    ended: Float[Array, ""]
    last_reversal: tuple[Float[Array, ""], Float[Array, ""]]
    sticking: Float[Array, ""]
    still: Float[Array, ""]


def first_log(x: Array, v: Array, capacity: int) -> Log:
    """The log of a motion from this state; the half-cycle that it is in, if any, has begun some time ago."""
    begun = jnp.where(v == 0, 0.0, -jnp.inf)
    points, never = jnp.full(capacity + 1, jnp.nan).at[0].set(x), jnp.asarray(jnp.inf)
    return Log(points, jnp.zeros((), int), jnp.zeros(()), (begun, x), never, never)


def bending(machine: Scaled) -> Array:
    """The way on which a contact bends from the strongest pull to one side to that to the other; zero for none."""
    stiffness = machine.contact_stiffness
    bends = stiffness > 0
    return jnp.where(bends, 2 * machine.hold / jnp.where(bends, stiffness, 1.0), 0.0) / machine.length


def _rings(machine: Scaled, length: Array, duration: Array) -> Array:
    """Whether a swing is that of a contact that holds the mass.

    One that is no longer than the contact bends is, for nothing slides, but where the contact is so soft that the mass
    swings on its own spring all the same. Let go at its strongest pull a contact swings through, up to twice as far.
    """
    bends = bending(machine)
    half_period = jnp.pi / jnp.sqrt(1 + machine.contact_stiffness / machine.oscillator.stiffness)
    stiff = half_period < _ABRUPT * jnp.pi
    return ((length <= bends) & stiff) | ((length <= 2 * bends) & (duration < _ABRUPT * jnp.pi))


def after_step(log: Log, machine: Scaled, shows: Array, before: tuple, behind: tuple) -> Log:
    """The log after a step.

    Args:
        log: the log before it.
        machine: the scaled machine.
        shows: scaled way from which on the ringing of a contact shows.
        before: time, displacement, velocity, acceleration and internal states at the begin of the step.
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
    """The log at the end of a motion at `x`: a last half-cycle that crept in without a reversal counts as well."""
    stops = jnp.isfinite(log.sticking)
    counts = stops & (jnp.abs(x - log.last_reversal[1]) > 2 * bending(machine))
    count = log.count + counts
    points = log.points.at[jnp.where(counts, count, log.points.size)].set(x, mode="drop")
    ended = jnp.where(counts, log.sticking, log.ended)
    return log._replace(points=points, count=count, ended=jnp.where(stops, ended, jnp.inf))


class ReversalRecorder(AbstractWrapper):
    """A solver that carries a log along.

    Attributes:
        solver: the solver that makes the steps. capacity: length of the list of half-cycles. record: from the log, and
        time and state at both ends of a step, and the arguments of the vector field, to the log
            behind it.
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
