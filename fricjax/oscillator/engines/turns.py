"""Integration over the phase of the half-cycles, for laws whose rates have a kink or a jump at each reversal.

With ``x = s x_d + a cos(theta)`` and ``v = -omega a sin(theta)`` the state is the amplitude a about the place where
dynamic friction balances the spring, the time, and the internal states of the law; the phase is what is integrated
over. The sign s, that of friction, is kept with the amplitude, and both change at each reversal: the amplitude by twice
the dead band. The mass turns where the phase is a multiple of pi, whatever the coefficients are: steps that end there
once do so for all of them. In time a reversal moves with the coefficients, and a contact that settles within a
microsecond of it would have to be met by the steps of each anew.

The phase carries a motion while the spring pulls clearly more than friction holds.
"""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .landing import Landing, last_step
from .mesh import Mesh, stepped
from .scaled import Cautious, Scaled, integrate

# The pull of the spring at a reversal from which the phase still carries the next half-cycle, in forces that friction
# can hold; the least phase velocity; and how near to a reversal a phase counts as there.
_PULL, _SLOWEST, _AT_REVERSAL = 1.05, 0.1, 1e-12
# Longest step, for the interpolation between its ends, and how much longer than the one before. Behind a reversal no
# step is then longer than the way from there, over which the rates of a contact grow: it may become stiffer on a mesh.
_LONGEST, _GROWTH = 0.25, 1.5


class Turned(NamedTuple):
    """A motion over the phase: what was asked for along it, and where it ended.

    Attributes:
        along: the nodes, or the phases of the ends of the steps, inf for those that were not needed.
        end: scaled displacement, velocity and internal states at the last one.
        elapsed: scaled time until there.
    """

    along: Any
    end: tuple
    elapsed: Array


class Span(NamedTuple):
    """How far an integration over the phase goes at most: to a scaled time, and over a number of half-cycles.

    `capacity` is the largest such number.
    """

    time: Array
    half_cycles: Array
    capacity: int


def turned(solver: Any, machine: Scaled, y0: tuple, mesh: Mesh) -> Turned:
    """The motion from a scaled state over the phases of a mesh.

    The phases carry no derivatives, so that those of their sines and cosines need not be computed; the state is carried
    to a phase that stands still instead, by a step of no length.
    """
    begin, first = _in_phase(y0, machine)
    moving = mesh.begun_at(begin)
    phases = jax.lax.stop_gradient(moving)
    slopes = _field(phases[0], first, machine)
    still = tuple(value + (phases[0] - moving[0]) * slope for value, slope in zip(first, slopes, strict=True))
    ys = stepped(_field, Landing(solver, _watched, _returned), phases, still, machine)
    nodes = machine.nodes(ys[1], *_in_time(phases, ys, machine))
    return _ended(nodes, phases[-1], jax.tree.map(lambda values: values[-1], ys), machine)


def turning(solver: Any, machine: Scaled, y0: tuple, tolerance: Any, span: Span, capacity: int) -> Turned:
    """The same with steps chosen by their error, to the end of `span` or as far as the phase carries the motion."""
    begin, first = _in_phase(y0, machine)
    turns = (jnp.floor(begin / jnp.pi) + 1 + jnp.arange(span.capacity)) * jnp.pi
    last = turns[jnp.clip(span.half_cycles, 1, span.capacity) - 1]
    chosen = Cautious(rtol=tolerance, atol=tolerance, dtmax=_LONGEST, factormax=_GROWTH)
    # Elements that stick or slip see that the mass has turned at the end of a step, so one just behind is short.
    behind = turns + last_step(tolerance)
    controller = diffrax.ClipStepSizeController(chosen, jump_ts=jnp.stack([turns, behind], axis=1).reshape(-1))

    def over(theta: Any, y: tuple, args: Scaled, **kwargs: Any) -> Array:
        return (y[1] >= span.time) | ~_carries(theta, y, args)

    end = jnp.where(over(begin, first, machine), begin, last)
    ends = diffrax.SubSaveAt(t0=True, steps=True, fn=lambda theta, y, args: None)
    saveat = diffrax.SaveAt(subs=[ends, diffrax.SubSaveAt(t1=True)])
    settings = {"saveat": saveat, "stepsize_controller": controller, "max_steps": capacity}
    landing, event = Landing(solver, _watched, _returned), diffrax.Event(over)
    solution = integrate(_field, landing, begin, end, first, machine, event=event, **settings)
    phases, last = solution.ts
    return _ended(phases, last[0], jax.tree.map(lambda values: values[0], solution.ys[1]), machine)


def _in_phase(y: tuple, machine: Scaled) -> tuple[Array, tuple]:
    """Phase, and signed amplitude, scaled time and internal states, from a scaled state in time."""
    x, v = y[:2]
    side = jnp.where(v == 0, jnp.sign(x), -jnp.sign(v))
    away = x - side * machine.band
    return jnp.arctan2(-v, away), (side * jnp.hypot(away, v), jnp.zeros(()), *y[2:])


def _in_time(theta: Any, y: tuple, machine: Scaled) -> tuple[Array, Array, tuple]:
    x = jnp.sign(y[0]) * machine.band + jnp.abs(y[0]) * jnp.cos(theta)
    return x, -jnp.abs(y[0]) * jnp.sin(theta), y[2:]


def _field(theta: Any, y: tuple, machine: Scaled) -> tuple:
    """Derivatives of amplitude, scaled time and scaled internal states by the phase."""
    x, v, states = _in_time(theta, y, machine)
    a, z = machine.rates(x, v, states)
    away = jnp.abs(y[0]) * jnp.cos(theta)
    pace = (v**2 - away * a) / y[0] ** 2
    return (v * (away + a) / (y[0] * pace), 1 / pace, *(rate / pace for rate in z))


def _carries(theta: Any, y: tuple, machine: Scaled) -> Array:
    """Whether the phase goes on: the mass turns back where it has turned, and on its way the phase does not dwell."""
    pull = jnp.abs(machine.pull(_in_time(theta, y, machine)[0]))
    turns_back = ~_turns(theta) | (pull > _PULL * machine.hold)
    waiting = _field(theta, y, machine)[1]
    return turns_back & (waiting < 1 / _SLOWEST) & (waiting > 0)


def _watched(theta: Any, y: tuple, machine: Scaled) -> Array:
    _, v, states = _in_time(theta, y, machine)
    return machine.switches(v, states)


def _returned(theta: Any, y: tuple, before: tuple, machine: Scaled) -> tuple:
    """The state from which the next step begins; at a reversal friction changes sign."""
    states = machine.mapped(*_in_time(theta, y, machine), before[2:])
    left = jnp.abs(y[0]) - 2 * machine.band
    turns_back = _turns(theta) & (left > 0)
    return (jnp.where(turns_back, -jnp.sign(y[0]) * left, y[0]), y[1], *states)


def _turns(theta: Any) -> Array:
    """Whether a phase is that of a reversal."""
    return jnp.abs(jnp.sin(theta)) < _AT_REVERSAL


def _ended(along: Any, theta: Any, y: tuple, machine: Scaled) -> Turned:
    x, v, states = _in_time(theta, y, machine)
    return Turned(along, (x, v, *states), y[1])
