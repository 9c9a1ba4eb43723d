"""Integration over the phase of the half-cycles, for laws whose rates have a kink or a jump at each reversal.

With ``x = a cos(theta)`` and ``v = -omega a sin(theta)`` the state is the amplitude a, the time and the internal states
of the law, and the phase is what is integrated over. The mass turns where the phase is a multiple of pi, whatever the
coefficients are: steps that end there once do so for all of them. In time a reversal moves with the coefficients, and
a contact that settles within a microsecond of it would have to be met by the steps of each anew.

The phase carries a motion while the spring pulls clearly more than friction holds.
"""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from .landing import Landing, last_step
from .mesh import Given, Mesh
from .scaled import EVERY_STEP, FIRST_STEP, Scaled, filled, integrate

# The pull of the spring at a reversal from which the phase still carries the next half-cycle, in forces that friction
# can hold; the least phase velocity; and how near to a reversal a phase counts as there.
_PULL, _SLOWEST, _AT_REVERSAL = 1.15, 0.1, 1e-9
# Longest step, for the interpolation between its ends.
_LONGEST = 0.25


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


def phase_of(y: tuple) -> Array:
    """Phase of a scaled state in time."""
    return jnp.arctan2(-y[1], y[0])


def turned(solver: Any, machine: Scaled, y0: tuple, mesh: Mesh) -> Turned:
    """The motion from a scaled state over the phases of a mesh.

    The phases carry no derivatives, so that those of their sines and cosines need not be computed; the state is carried
    to a phase that stands still instead, by a step of no length.
    """
    first, moving = _in_phase(y0), mesh.begun_at(phase_of(y0))
    phases = jax.lax.stop_gradient(moving)
    slopes = _field(phases[0], first, machine)
    still = tuple(value + (phases[0] - moving[0]) * slope for value, slope in zip(first, slopes, strict=True))
    settings = {"saveat": EVERY_STEP, "stepsize_controller": Given(phases), "max_steps": phases.size - 1}
    solution = integrate(_field, _landing(solver, machine), phases[0], phases[-1], still, machine, **settings)
    theta, ys = filled(solution.ts, solution.ys)
    nodes = machine.nodes(ys[1], *_in_time(theta, ys))
    return _ended(nodes, theta[-1], jax.tree.map(lambda values: values[-1], ys))


def turning(solver: Any, machine: Scaled, y0: tuple, tolerance: Any, span: Span, capacity: int) -> Turned:
    """The same with steps chosen by their error, to the end of `span` or as far as the phase carries the motion."""
    begin, first = phase_of(y0), _in_phase(y0)
    turns = (jnp.floor(begin / jnp.pi) + 1 + jnp.arange(span.capacity)) * jnp.pi
    last = turns[jnp.clip(span.half_cycles, 1, span.capacity) - 1]
    chosen = diffrax.PIDController(rtol=tolerance, atol=tolerance, dtmax=_LONGEST)
    # Elements that stick or slip see that the mass has turned at the end of a step, so one just behind is short.
    behind = turns + last_step(tolerance)
    controller = diffrax.ClipStepSizeController(chosen, jump_ts=jnp.stack([turns, behind], axis=1).reshape(-1))

    def over(theta: Any, y: tuple, args: Scaled, **kwargs: Any) -> Array:
        return (y[1] >= span.time) | ~_carries(theta, y, args)

    end = jnp.where(over(begin, first, machine), begin, last)
    ends = diffrax.SubSaveAt(t0=True, steps=True, fn=lambda theta, y, args: None)
    saveat = diffrax.SaveAt(subs=[ends, diffrax.SubSaveAt(t1=True)])
    settings = {"saveat": saveat, "stepsize_controller": controller, "max_steps": capacity}
    settings |= {"dt0": FIRST_STEP, "event": diffrax.Event(over)}
    solution = integrate(_field, _landing(solver, machine), begin, end, first, machine, **settings)
    phases, last = solution.ts
    return _ended(phases, last[0], jax.tree.map(lambda values: values[0], solution.ys[1]))


def _landing(solver: Any, machine: Scaled) -> Any:
    return Landing(solver, _watched, _returned) if machine.oscillator.friction.n_states else solver


def _in_phase(y: tuple) -> tuple:
    """Amplitude, scaled time and internal states from a scaled state in time."""
    return (jnp.hypot(y[0], y[1]), jnp.zeros(()), *y[2:])


def _in_time(theta: Any, y: tuple) -> tuple[Array, Array, tuple]:
    return y[0] * jnp.cos(theta), -y[0] * jnp.sin(theta), y[2:]


def _field(theta: Any, y: tuple, machine: Scaled) -> tuple:
    """Derivatives of amplitude, scaled time and scaled internal states by the phase."""
    x, v, states = _in_time(theta, y)
    a, z = machine.rates(x, v, states)
    pace = (v**2 - x * a) / y[0] ** 2
    return (v * (x + a) / (y[0] * pace), 1 / pace, *(rate / pace for rate in z))


def _carries(theta: Any, y: tuple, machine: Scaled) -> Array:
    """Whether the phase goes on: the mass turns back where it has turned, and on its way the phase does not dwell."""
    oscillator = machine.oscillator
    law, load = oscillator.friction, oscillator.normal_force
    hold = jnp.maximum(law.static_force(load), law.dynamic_force(load))
    pull = oscillator.restoring_force(y[0] * machine.length)
    turns_back = (jnp.abs(jnp.sin(theta)) > _AT_REVERSAL) | (pull > _PULL * hold)
    waiting = _field(theta, y, machine)[1]
    return turns_back & (waiting < 1 / _SLOWEST) & (waiting > 0)


def _watched(theta: Any, y: tuple, machine: Scaled) -> Array:
    _, v, states = _in_time(theta, y)
    return machine.switches(v, states)


def _returned(theta: Any, y: tuple, machine: Scaled) -> tuple:
    return (*y[:2], *machine.mapped(*_in_time(theta, y)))


def _ended(along: Any, theta: Any, y: tuple) -> Turned:
    x, v, states = _in_time(theta, y)
    return Turned(along, (x, v, *states), y[1])
