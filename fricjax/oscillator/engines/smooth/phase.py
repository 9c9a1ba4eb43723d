"""Integration over the phase of half-cycles, and afterwards in time.

It suits laws with rates that have a kink or a jump at each reversal.

With ``x = s x_d + a cos(theta)`` and ``v = -omega a sin(theta)`` the state consists of the amplitude a about the
equilibrium of spring and dynamic friction, the time, and the internal states of the law. The phase is the independent
variable. The sign s of friction is stored with the amplitude. At each reversal the sign changes, and the amplitude
changes by twice the dead band. Reversals lie at multiples of pi for all coefficients, so steps that end there once do
so for any of them. In time, a reversal would move with the coefficients. A contact that settles within a microsecond of
it would require new steps for each of them.

The phase resolves a motion as long as the spring pulls clearly harder than friction holds. The rest is integrated in
time, with displacement and velocity replacing amplitude and time. One vector field serves both, so a program contains
the law only once.
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

# Smallest pull of the spring at a reversal for which the phase resolves the next half-cycle, relative to the holding
# force of friction; smallest phase velocity; and tolerance for the phase of a reversal.
_PULL, _SLOWEST, _AT_REVERSAL = 1.05, 0.1, 1e-12
# Longest step, limited by the interpolation between its ends, and largest growth of a step. After a reversal no step is
# then longer than the distance from it, over which the rates of a contact grow and may become stiffer on a mesh.
_LONGEST, _GROWTH = 0.25, 1.5


class FieldArgs(NamedTuple):
    """Arguments of the vector field.

    Attributes:
        machine: the scaled oscillator.
        in_phase: whether the independent variable is the phase or scaled time.
    """

    machine: Scaled
    in_phase: Array


class PhaseSolution(NamedTuple):
    """End of a motion integrated over the phase.

    Attributes:
        phases: ends of the steps, padded with inf.
        end: final scaled displacement, velocity and internal states.
        elapsed: scaled time at the end.
    """

    phases: Array
    end: tuple
    elapsed: Array


class Limits(NamedTuple):
    """Limits of an integration over the phase.

    Attributes:
        time: scaled time.
        half_cycles: number of half-cycles.
        capacity: maximum number of half-cycles.
    """

    time: Array
    half_cycles: Array
    capacity: int


def follow_mesh(solver: Any, machine: Scaled, y0: tuple, mesh: Mesh) -> tuple[Nodes, tuple]:
    """Integrate over a mesh; return nodes and the final scaled state.

    The phases carry no derivatives, which saves differentiating their sines and cosines. Instead a step of zero length
    moves the state to a phase that does not depend on the parameters.
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
    """Choose steps over the phase by their error, up to the `limits`.

    The integration ends earlier if the phase no longer advances.
    """
    begin, first = _in_phase(y0, machine)
    reversals = (jnp.floor(begin / jnp.pi) + 1 + jnp.arange(limits.capacity)) * jnp.pi
    last = reversals[jnp.clip(limits.half_cycles, 1, limits.capacity) - 1]
    chosen = Cautious(rtol=tolerance, atol=tolerance, dtmax=_LONGEST, factormax=_GROWTH)
    # Sticking and slipping elements detect a reversal at the end of a step, so the step just after it is short.
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
    """Convert a scaled state to phase, signed amplitude, time and internal states."""
    x, v = y[:2]
    side = jnp.where(v == 0, jnp.sign(x), -jnp.sign(v))
    away = x - side * machine.band
    return jnp.arctan2(-v, away), (side * jnp.hypot(away, v), jnp.zeros(()), *y[2:])


def _places(s: Any, y: tuple, args: FieldArgs) -> tuple[Array, Array, tuple]:
    """Return scaled displacement, velocity and internal states from the integrated state."""
    machine, in_phase = args
    reach = jnp.abs(y[0])
    x = jnp.where(in_phase, jnp.sign(y[0]) * machine.band + reach * jnp.cos(s), y[0])
    return x, jnp.where(in_phase, -reach * jnp.sin(s), y[1]), y[2:]


def field(s: Any, y: tuple, args: FieldArgs) -> tuple:
    """Return the derivatives of the scaled state.

    In phase: of amplitude, time and internal states. In time: of displacement, velocity and internal states.
    """
    machine, in_phase = args
    x, v, states = _places(s, y, args)
    a, z = machine.rates(x, v, states)
    away = jnp.abs(y[0]) * jnp.cos(s)
    pace = (v**2 - away * a) / y[0] ** 2
    # Forward-mode derivatives of the branch that is not selected have no effect.
    lasts = jnp.where(in_phase, 1 / pace, 1.0)
    first = jnp.where(in_phase, v * (away + a) / (y[0] * pace), v)
    return first, jnp.where(in_phase, lasts, a), *(rate * lasts for rate in z)


def _is_resolved(theta: Any, y: tuple, args: FieldArgs) -> Array:
    """Return True if the phase advances.

    At a reversal the spring must move the mass back; between reversals the phase must not stall.
    """
    machine = args.machine
    pull = jnp.abs(machine.pull(_places(theta, y, args)[0]))
    reverses = ~_is_reversal(theta) | (pull > _PULL * machine.hold)
    waiting = field(theta, y, args)[1]
    return reverses & (waiting < 1 / _SLOWEST) & (waiting > 0)


def switching_quantities(s: Any, y: tuple, args: FieldArgs) -> Array:
    """Return the switching quantities of the law.

    In time they include the velocity; in phase the steps end at the reversals anyway.
    """
    _, v, states = _places(s, y, args)
    in_time = jnp.where(args.in_phase, 1.0, v)
    return jnp.concatenate([jnp.reshape(in_time, (1,)), args.machine.switches(v, states)])


def after_switch(s: Any, y: tuple, before: tuple, args: FieldArgs) -> tuple:
    """Return the state at the start of the next step.

    At a reversal in phase the sign of friction changes.
    """
    machine, in_phase = args
    states = machine.mapped(*_places(s, y, args), before[2:])
    left = jnp.abs(y[0]) - 2 * machine.band
    reverses = in_phase & _is_reversal(s) & (left > 0)
    return (jnp.where(reverses, -jnp.sign(y[0]) * left, y[0]), y[1], *states)


def _is_reversal(theta: Any) -> Array:
    """Return True if a phase is that of a reversal."""
    return jnp.abs(jnp.sin(theta)) < _AT_REVERSAL
