"""Integrations behind the smooth engine, adaptive in time or on a mesh."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ...motion import Motion, Start
from ...oscillator import Drive, Oscillator
from ...outcome import RESULTS
from ..nodes import Nodes
from .phase import FieldArgs, Limits, after_switch, choose_phase_steps, field, follow_mesh, switching_quantities
from .reversals import Log, ReversalRecorder, after_step, last_log
from .rosenbrock import Rodas5P
from .scaled import Cautious, Scaled, continued, integrate
from .switching import SecantSteps, SwitchingSolver, step_across

# Remaining distance of a mass that counts as resting, relative to the tolerance.
_STILL = 0.1
# Scaled time within which a motion must come to rest: ten thousand half-periods.
_LONG = 1e4 * np.pi
# Contact vibration that is visible in a sampled motion, relative to its accuracy; less is below the step errors.
_SHOWS = 0.1
# Tolerance factor for a sampled motion with internal states: the undamped vibration of a contact adds up step errors.
# experiments/laws/accuracy.py counts the misses.
_STATES = 0.1
# Factor on `still` for a resting mass on a mesh made for another motion.
_MOVED = 2.0


@runtime_checkable
class Settings(Protocol):
    """Fields of the smooth engine that an integration depends on."""

    name: ClassVar[str]
    counted: ClassVar[tuple[str, ...]]
    accuracy: Any
    mesh: Any
    max_steps: int
    max_half_cycles: int
    still: Any
    method: Any


class _Args(NamedTuple):
    """Arguments of the vector field.

    Attributes:
        machine: the scaled oscillator.
        shows: scaled distance above which vibration is visible, for the log.
    """

    machine: Scaled
    shows: Any = None


def _field(tau: Any, y: Any, args: _Args) -> tuple:
    """Return the rates of the scaled state in scaled time.

    The state is (x, v, internal states...).
    """
    machine = args.machine
    a, states = machine.rates(y[0], y[1], y[2:])
    a = a + machine.push(tau) / (machine.oscillator.mass * machine.speed * machine.rate)
    return (y[1], a, *states)


def path(engine: Settings, oscillator: Oscillator, start: Start) -> Nodes:
    """See `Smooth.path`."""
    if engine.mesh is None:
        raise ValueError("A path of the smooth engine needs a mesh: make one with Smooth.meshed.")
    machine = Scaled.of(oscillator, start)
    motion, (x, v, states) = follow_mesh(_plain(oscillator), machine, machine.start(start), engine.mesh)
    place, way = machine.settling(x, v, states)
    # The mesh was made for other coefficients, for which the distance was smaller.
    sticks = way * machine.length < _MOVED * engine.still
    position = jnp.where(sticks, place, x) * machine.length
    return eqx.tree_at(lambda n: (n.rest_position, n.finished), motion, (position, jnp.asarray(True)))


def trail(engine: Settings, oscillator: Oscillator, start: Start, duration: Float[Array, ""]) -> Nodes:
    """See `Smooth.trail`."""
    machine = Scaled.of(oscillator, start)
    end = duration * machine.rate
    every = diffrax.SaveAt(t0=True, steps=True)
    solution = _free(engine, machine.start(start), _Args(machine), end, every, engine.max_steps)
    last = jnp.sum(jnp.isfinite(solution.ts)) - 1
    made = jnp.minimum(jnp.arange(solution.ts.size), last)
    tau, (x, v, *states) = jax.tree.map(lambda values: values[made], (solution.ts, solution.ys))
    return machine.nodes(tau, x, v, tuple(states))


def meshed(
    engine: Settings, oscillator: Oscillator, start: Start, duration: Array, half_cycles: Array | None, capacity: int
) -> tuple[Array, Array]:
    """See `Smooth.meshed`."""
    machine = Scaled.of(oscillator, start)
    tolerance, end = _tolerance(engine, machine), duration * machine.rate
    most = engine.max_half_cycles
    limits = Limits(end, jnp.asarray(most if half_cycles is None else half_cycles), most)
    first = choose_phase_steps(_plain(oscillator), machine, machine.start(start), tolerance, limits, capacity)
    left = jnp.maximum(end - first.elapsed, 0.0)
    waiting = FieldArgs(machine, jnp.asarray(False))
    rests = _resting(field, tolerance, left, engine.still / machine.length)
    switching = SwitchingSolver(_plain(oscillator), switching_quantities, after_switch)
    solver, controller = _chosen(engine, machine, switching)
    settings = {"saveat": _ENDS, "stepsize_controller": controller, "max_steps": capacity}
    event = diffrax.Event(rests)
    then = integrate(field, solver, jnp.zeros(()), left, first.end, waiting, event=event, **settings)
    # Rejected steps count too. If most were rejected, the motion grows without bound and more steps would not help.
    short = (then.result == diffrax.RESULTS.max_steps_reached) & jnp.isfinite(then.ts[capacity // 2])
    return first.phases, jnp.where(short & jnp.isinf(then.ts), left, then.ts)


def solve(
    engine: Settings,
    oscillator: Oscillator,
    start: Start,
    ts: Float[Array, " samples"],
    drive: Drive | None,
) -> Motion:
    """See `Smooth.solve`."""
    machine, x, v, state, solution = _integrate(engine, oscillator, start, ts, drive)
    load = oscillator.normal_force
    friction = jax.vmap(lambda speed, z: oscillator.friction.force(speed, z, load))(v, state)
    log = solution.solver_state[1]
    at_rest, t_stop = jnp.zeros(ts.shape, bool), jnp.asarray(jnp.inf)
    if drive is None and oscillator.friction.n_states:
        log = last_log(log, machine, solution.ys[0][-1])
        at_rest, t_stop = ts * machine.rate >= log.still, log.ended / machine.rate
    return Motion(
        t=ts,
        x=x,
        v=v,
        friction_force=friction,
        at_rest=at_rest,
        t_stop=t_stop,
        turning_points=log.points * machine.length,
        n_half_cycles=log.count,
        regularisation_bias=jnp.zeros(()),
        engine=engine.name,
        result=RESULTS.promote(solution.result),
        stats={name: solution.stats[name] for name in engine.counted},
    )


def rest(engine: Settings, oscillator: Oscillator, start: Start) -> Array:
    """See `Smooth.rest`."""
    machine = Scaled.of(oscillator, start)
    rests = _resting(_field, _tolerance(engine, machine), jnp.asarray(_LONG), engine.still / machine.length)
    y0, end, one = machine.start(start), jnp.asarray(_LONG), diffrax.SaveAt(t1=True)
    solution = _free(engine, y0, _Args(machine), end, one, engine.max_steps, diffrax.Event(rests))
    x, v, *states = (values[-1] for values in solution.ys)
    place, way = machine.settling(x, v, tuple(states))
    position = jnp.where(way * machine.length < engine.still, place, x) * machine.length
    return jnp.where(solution.result == diffrax.RESULTS.event_occurred, position, jnp.nan)


def _integrate(engine: Settings, oscillator: Oscillator, start: Start, ts: Array, drive: Drive | None) -> tuple:
    """Integrate in time and sample at `ts`.

    Returns:
        The scaled oscillator, displacement, velocity, internal states, and the solution.
    """
    machine = Scaled.of(oscillator, start, drive)
    tau = jnp.maximum(ts, 0.0) * machine.rate
    args = _Args(machine, jnp.asarray(_SHOWS * engine.accuracy / machine.length))
    y0 = machine.start(start)
    saved = diffrax.SaveAt(ts=tau, solver_state=True)
    most = engine.max_half_cycles
    if len(y0) > 2:
        engine = eqx.tree_at(lambda e: e.accuracy, engine, _STATES * engine.accuracy)
    solution = _free(engine, y0, args, jnp.maximum(tau[-1], 1e-9), saved, engine.max_steps, recorded=most)
    x, v = solution.ys[0] * machine.length, solution.ys[1] * machine.speed
    state = jnp.stack(solution.ys[2:], axis=-1) * machine.state if len(y0) > 2 else jnp.zeros((ts.shape[0], 0))
    a0 = _field(jnp.zeros(()), y0, args)[1] * machine.speed * machine.rate if drive is None else None
    return machine, *continued(ts, start, a0, x, v), state, solution


def _free(
    engine: Settings,
    y0: tuple,
    args: _Args,
    end: Array,
    saveat: Any,
    max_steps: int,
    event: Any = None,
    recorded: int | None = None,
) -> Any:
    """Integrate in time with steps chosen by their error.

    With `recorded`, the length of the list, the solver keeps a log of the reversals.
    """
    tolerance = _tolerance(engine, args.machine)
    method = _plain(args.machine.oscillator) if engine.method is None else _with_tolerances(engine.method, tolerance)
    solver, controller = _chosen(engine, args.machine, SwitchingSolver(method, _switching_quantities, _after_switch))
    settings = {"saveat": saveat, "stepsize_controller": controller, "max_steps": max_steps, "event": event}
    with_log = solver if recorded is None else ReversalRecorder(solver, recorded, _record)
    return integrate(_field, with_log, jnp.zeros(()), end, y0, args, **settings)


def _chosen(
    engine: Settings, machine: Scaled, switching: SwitchingSolver
) -> tuple[diffrax.AbstractAdaptiveSolver, Any]:
    """Return solver and controller in time.

    Steps end at the kinks in the rates of a law with internal states.
    """
    tolerance = _tolerance(engine, machine)
    if engine.method is not None:
        return switching, Cautious(rtol=tolerance, atol=tolerance)
    if not machine.oscillator.friction.n_states:
        return switching.solver, diffrax.PIDController(rtol=tolerance, atol=tolerance)
    return switching, SecantSteps(Cautious(rtol=tolerance, atol=tolerance), step_across(tolerance))


def _with_tolerances(method: Any, tolerance: Array) -> Any:
    """Set the options that a wrapped solver cannot take from its controller."""
    if isinstance(method, diffrax.AbstractImplicitSolver):
        finder = method.root_finder
        taken = {"rtol": tolerance, "atol": tolerance, "norm": optx.rms_norm}
        # The placeholder of diffrax is neither a number nor a function.
        missing = {
            n: v
            for n, v in taken.items()
            if not (eqx.is_array_like(getattr(finder, n)) or callable(getattr(finder, n)))
        }
        method = dataclasses.replace(method, root_finder=dataclasses.replace(finder, **missing))
    if getattr(method, "scan_kind", "lax") is None:
        method = dataclasses.replace(method, scan_kind="lax")
    return method


def _tolerance(engine: Settings, machine: Scaled) -> Array:
    # Over fifty half-cycles the errors of the steps add up to about thirty times the tolerance.
    return jnp.maximum(0.02 * engine.accuracy / machine.length, 1e-14)


_ENDS = diffrax.SaveAt(t0=True, steps=True, fn=lambda t, y, args: None)


def _record(log: Log, before: tuple, behind: tuple, args: _Args) -> Log:
    """Update the log after a step from both of its ends."""
    (t0, y0), (t1, y1) = before, behind
    ends = ((t, y[0], y[1], _field(t, y, args)[1], y[2:]) for t, y in ((t0, y0), (t1, y1)))
    return after_step(log, args.machine, args.shows, *ends)


def _resting(field: Callable, tolerance: Any, left: Any, still: Any) -> Callable[..., Array]:
    """Return an event for a mass that rests.

    Either speed and acceleration no longer move the mass, or the contact has practically stopped it.

    Args:
        field: the vector field of the motion in time.
        tolerance: tolerance of the integration.
        left: scaled time during which the motion of a resting mass must stay invisible.
        still: scaled distance over which the contact may still spring back and vibrate.
    """

    def rests(tau: Any, y: tuple, args: Any, **kwargs: Any) -> Array:
        _, way = args.machine.settling(y[0], y[1], y[2:])
        stands = (jnp.abs(y[1]) * (1 + left) < _STILL * tolerance) & (jnp.abs(field(tau, y, args)[1]) < tolerance)
        return stands | (way < still)

    return rests


def _plain(oscillator: Oscillator) -> diffrax.AbstractAdaptiveSolver:
    """Return the solver for a law: implicit if the law is stiff."""
    law = oscillator.friction
    return Rodas5P(modes=law.n_modes) if law.stiff else diffrax.Dopri8(scan_kind="lax")


def _switching_quantities(tau: Any, y: tuple, args: _Args) -> Array:
    """Return the velocity and the other switching quantities of the law."""
    return jnp.concatenate([jnp.reshape(y[1], (1,)), args.machine.switches(y[1], y[2:])])


def _after_switch(tau: Any, y: tuple, before: tuple, args: _Args) -> tuple:
    """Return the scaled state at the start of the next step."""
    return (*y[:2], *args.machine.mapped(y[0], y[1], y[2:], before[2:]))
