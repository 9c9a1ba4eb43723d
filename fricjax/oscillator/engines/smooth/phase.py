"""Integration over the phase of the half-cycles, and behind the last of them in time, by one field for both.

It is for laws whose rates have a kink or a jump at each reversal.

With ``x = s x_d + a cos(theta)`` and ``v = -omega a sin(theta)`` the state is the amplitude a about the place where
dynamic friction balances the spring, the time, and the internal states of the law; the phase is what is integrated
over. The sign s, that of friction, is kept with the amplitude, and both change at each reversal: the amplitude by twice
the dead band. The mass turns where the phase is a multiple of pi, whatever the coefficients are: steps that end there
once do so for all of them. In time a reversal moves with the coefficients, and a contact that settles within a
microsecond of it would have to be met by the steps of each anew.

The phase resolves a motion while the spring pulls clearly more than friction holds. What is left is integrated in time,
with displacement and velocity in the places of amplitude and time. The law stands once in a program for both.
"""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array

from ..nodes import Nodes
from .mesh import Mesh, Steps, stepped
from .scaled import Cautious, Scaled, integrate
from .switching import SwitchingSolver, step_across

# The pull of the spring at a reversal from which the phase still resolves the next half-cycle, in forces that friction
# can hold; the least phase velocity; and how near to a reversal a phase counts as there.
_PULL, _SLOWEST, _AT_REVERSAL = 1.05, 0.1, 1e-12
# Longest step, for the interpolation between its ends, and how much longer than the one before. Behind a reversal no
# step is then longer than the way from there, over which the rates of a contact grow: it may become stiffer on a mesh.
_LONGEST, _GROWTH = 0.25, 1.5


class FieldArgs(NamedTuple):
    """Arguments of the vector field: the machine, and whether it is integrated over its phase or in scaled time."""

    machine: Scaled
    in_phase: Array


class PhaseSolution(NamedTuple):
    """Where a motion over the phase ended.

    Attributes:
        phases: ends of the steps, inf for those that were not needed.
        end: scaled displacement, velocity and internal states at the last one.
        elapsed: scaled time until there.
    """

    phases: Array
    end: tuple
    elapsed: Array


class Limits(NamedTuple):
    """How far an integration over the phase goes at most: to a scaled time, and over a number of half-cycles.

    `capacity` is the largest such number.
    """

    time: Array
    half_cycles: Array
    capacity: int


def follow_mesh(solver: Any, machine: Scaled, y0: tuple, mesh: Mesh) -> tuple[Nodes, tuple]:
    """The motion from a scaled state over the phases and times of a mesh, and the scaled state in which it ends.

    The phases carry no derivatives, so that those of their sines and cosines need not be computed; the state is carried
    to a phase that stands still instead, by a step of no length.
    """
    begin, first = _in_phase(y0, machine)
    over = FieldArgs(machine, jnp.asarray(True))
    still = jax.lax.stop_gradient(begin)
    ends = mesh.begun_at(still)
    n_phase = jnp.asarray(mesh.n_phase)
    count = n_phase + mesh.n_time
    slopes = field(ends[0], first, over)
    entered_state = tuple(value + (still - begin) * slope for value, slope in zip(first, slopes, strict=True))

    def entered(i: Array, y: tuple) -> tuple[tuple, FieldArgs]:
        x, v, _ = _places(ends[n_phase], y, over)
        left = i == n_phase
        y = (jnp.where(left, x, y[0]), jnp.where(left, v, y[1]), *y[2:])
        return y, FieldArgs(machine, i < n_phase)

    number = jnp.arange(ends.size)
    begins = jnp.where(number == n_phase, 0.0, ends)
    ys = stepped(
        field,
        SwitchingSolver(solver, switching_quantities, after_switch),
        Steps(begins[:-1], ends[1:], count),
        entered_state,
        entered,
    )
    made = jnp.minimum(number, count)
    in_phase = made <= n_phase
    x, v, states = _places(ends[made], ys, FieldArgs(machine, in_phase))
    nodes = machine.nodes(jnp.where(in_phase, ys[1], ys[1][n_phase] + ends[made]), x, v, states)
    return nodes, (x[-1], v[-1], tuple(values[-1] for values in states))


def choose_phase_steps(
    solver: Any, machine: Scaled, y0: tuple, tolerance: Any, limits: Limits, capacity: int
) -> PhaseSolution:
    """The steps over the phase that their error chooses, to the `limits` or as far as the phase goes."""
    begin, first = _in_phase(y0, machine)
    reversals = (jnp.floor(begin / jnp.pi) + 1 + jnp.arange(limits.capacity)) * jnp.pi
    last = reversals[jnp.clip(limits.half_cycles, 1, limits.capacity) - 1]
    chosen = Cautious(rtol=tolerance, atol=tolerance, dtmax=_LONGEST, factormax=_GROWTH)
    # Elements that stick or slip see that the mass has turned at the end of a step, so one just behind is short.
    behind = reversals + step_across(tolerance)
    controller = diffrax.ClipStepSizeController(chosen, jump_ts=jnp.stack([reversals, behind], axis=1).reshape(-1))
    everywhere = FieldArgs(machine, jnp.asarray(True))

    def over(theta: Any, y: tuple, args: FieldArgs, **kwargs: Any) -> Array:
        return (y[1] >= limits.time) | ~_is_resolved(theta, y, args)

    end = jnp.where(over(begin, first, everywhere), begin, last)
    ends = diffrax.SubSaveAt(t0=True, steps=True, fn=lambda theta, y, args: None)
    saveat = diffrax.SaveAt(subs=[ends, diffrax.SubSaveAt(t1=True)])
    settings = {"saveat": saveat, "stepsize_controller": controller, "max_steps": capacity}
    switching, event = SwitchingSolver(solver, switching_quantities, after_switch), diffrax.Event(over)
    solution = integrate(field, switching, begin, end, first, everywhere, event=event, **settings)
    phases, last = solution.ts
    y = jax.tree.map(lambda values: values[0], solution.ys[1])
    x, v, states = _places(last[0], y, everywhere)
    return PhaseSolution(phases, (x, v, *states), y[1])


def _in_phase(y: tuple, machine: Scaled) -> tuple[Array, tuple]:
    """Phase, and signed amplitude, scaled time and internal states, from a scaled state in time."""
    x, v = y[:2]
    side = jnp.where(v == 0, jnp.sign(x), -jnp.sign(v))
    away = x - side * machine.band
    return jnp.arctan2(-v, away), (side * jnp.hypot(away, v), jnp.zeros(()), *y[2:])


def _places(s: Any, y: tuple, args: FieldArgs) -> tuple[Array, Array, tuple]:
    """Scaled displacement, velocity and internal states at a phase, or in time."""
    machine, in_phase = args
    reach = jnp.abs(y[0])
    x = jnp.where(in_phase, jnp.sign(y[0]) * machine.band + reach * jnp.cos(s), y[0])
    return x, jnp.where(in_phase, -reach * jnp.sin(s), y[1]), y[2:]


def field(s: Any, y: tuple, args: FieldArgs) -> tuple:
    """Derivatives by the phase of amplitude, time and internal states; by time, of displacement, velocity and states.

    All of it is scaled.
    """
    machine, in_phase = args
    x, v, states = _places(s, y, args)
    a, z = machine.rates(x, v, states)
    away = jnp.abs(y[0]) * jnp.cos(s)
    pace = (v**2 - away * a) / y[0] ** 2
    # Derivatives go forwards, so that those of what is not chosen are not felt.
    lasts = jnp.where(in_phase, 1 / pace, 1.0)
    first = jnp.where(in_phase, v * (away + a) / (y[0] * pace), v)
    return first, jnp.where(in_phase, lasts, a), *(rate * lasts for rate in z)


def _is_resolved(theta: Any, y: tuple, args: FieldArgs) -> Array:
    """Whether the phase goes on: at a reversal the mass moves back, and in between the phase does not dwell."""
    machine = args.machine
    pull = jnp.abs(machine.pull(_places(theta, y, args)[0]))
    reverses = ~_is_reversal(theta) | (pull > _PULL * machine.hold)
    waiting = field(theta, y, args)[1]
    return reverses & (waiting < 1 / _SLOWEST) & (waiting > 0)


def switching_quantities(s: Any, y: tuple, args: FieldArgs) -> Array:
    """What the law switches by, in time the velocity among it; in the phase the steps end at the reversals anyway."""
    _, v, states = _places(s, y, args)
    in_time = jnp.where(args.in_phase, 1.0, v)
    return jnp.concatenate([jnp.reshape(in_time, (1,)), args.machine.switches(v, states)])


def after_switch(s: Any, y: tuple, before: tuple, args: FieldArgs) -> tuple:
    """The state from which the next step begins; at a reversal in the phase friction changes sign."""
    machine, in_phase = args
    states = machine.mapped(*_places(s, y, args), before[2:])
    left = jnp.abs(y[0]) - 2 * machine.band
    reverses = in_phase & _is_reversal(s) & (left > 0)
    return (jnp.where(reverses, -jnp.sign(y[0]) * left, y[0]), y[1], *states)


def _is_reversal(theta: Any) -> Array:
    """Whether a phase is that of a reversal."""
    return jnp.abs(jnp.sin(theta)) < _AT_REVERSAL
