"""Integration in time, for laws without a jump: bristle laws, regularised laws and their creep, driven motion.

An adaptive integration is a rough function of its parameters, since each choice of steps has its own error. For a
fit the steps are found once and kept as a mesh in the phase of the half-cycles, and behind the last ones in time: the
motion is then a smooth function of every coefficient, and its derivatives are exactly those of the discrete solution.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...motion import Motion, Start
from ...oscillator import Drive, Oscillator
from ...outcome import RESULTS
from ..base import AbstractEngine, Demands
from ..nodes import Nodes
from .mesh import Mesh
from .phase import FieldArgs, Limits, after_switch, choose_phase_steps, field, follow_mesh, switching_quantities
from .reversals import Log, ReversalRecorder, after_step, last_log
from .rosenbrock import Rodas5P
from .scaled import Cautious, Scaled, continued, integrate
from .switching import SecantSteps, SwitchingSolver, step_across

# The way that a mass may still go and count as resting, in tolerances.
_STILL = 0.1
# Scaled time in which a motion must have come to rest: ten thousand half-periods.
_LONG = 1e4 * np.pi
# Ringing that shows in a sampled motion, in its accuracy: less is lost in the errors of the steps.
_SHOWS = 0.1
# How much finer a motion is integrated of which only the end is asked for.
_FINER = 100.0
# How much longer than `still` the way of a mass that rests may be on a mesh that was made for another motion.
_MOVED = 2.0


class _Args(NamedTuple):
    """Arguments of the vector field: the scaled machine; for the log the scaled way from which on ringing shows."""

    machine: Scaled
    shows: Any = None


def _field(tau: Any, y: Any, args: _Args) -> tuple:
    """Rates of the scaled state (x, v, internal states...) in scaled time."""
    machine = args.machine
    a, states = machine.rates(y[0], y[1], y[2:])
    a = a + machine.push(tau) / (machine.oscillator.mass * machine.speed * machine.rate)
    return (y[1], a, *states)


class Smooth(AbstractEngine):
    """Integration in time with a Rosenbrock solver, and on a mesh over the phase of the half-cycles first.

    Attributes:
        accuracy: largest error of the displacement aimed at [m].
        mesh: ends of the steps for :meth:`path`; :meth:`solve` lets the error estimate choose them.
        max_steps: bound on the number of steps.
        max_half_cycles: length of the list of turning points, and most half-cycles of a mesh in phase.
        still: way on which a contact may still spring back and ring while the mass is taken to be at rest [m]. It is
            far below the accuracy, for a lightly damped contact creeps under its ringing, hundreds of times as far.
        method: solver of diffrax for :meth:`solve`, with its own controller; None: Rodas5P where a law is stiff, else
            Dopri8, by steps that end at reversals.

    Examples:
        >>> print(f"{Smooth(accuracy=1e-10).finer().accuracy:.0e} m")
        1e-11 m
    """

    name: ClassVar[str] = "smooth"
    counted: ClassVar[tuple[str, ...]] = ("num_steps", "num_rejected_steps")
    needs_mesh: ClassVar[bool] = True
    takes_drive: ClassVar[bool] = True
    accuracy: float | Float[Array | np.ndarray, ""] = 1e-10
    mesh: Mesh | None = None
    max_steps: int = eqx.field(static=True, default=1_000_000)
    max_half_cycles: int = eqx.field(static=True, default=512)
    still: float | Float[Array | np.ndarray, ""] = 1e-13
    # Of its fields some are no arrays, so that it shapes the computation.
    method: diffrax.AbstractAdaptiveSolver | None = eqx.field(static=True, default=None)

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        if oscillator.friction.set_valued:
            return (
                f"The smooth engine cannot integrate the jump of {type(oscillator.friction).__name__}. Use the exact "
                "or the hybrid engine, or a regularised law such as Tanh."
            )
        if oscillator.restoring.hysteretic:
            return (
                "The smooth engine cannot integrate the internal friction of a structural spring, which jumps at each "
                "reversal. Use the hybrid engine with a law without internal states."
            )
        return None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Smooth":
        # Its error is some ten times smaller than the accuracy that it is asked for.
        accuracy = np.asarray(demands.accuracy)
        return Smooth(accuracy, None, self.max_steps, self.max_half_cycles, accuracy)

    def finer(self) -> "Smooth":
        return self.at_accuracy(self.accuracy / 10)

    def at_accuracy(self, accuracy: Any) -> "Smooth":
        """The engine without a mesh, for another accuracy [m]."""
        return dataclasses.replace(self, accuracy=accuracy, mesh=None)

    def on_mesh(self, phases: np.ndarray, times: np.ndarray, size: int) -> "Smooth":
        """The engine with the steps of `meshed`, in a list with room for `size` of them."""
        return dataclasses.replace(self, mesh=Mesh.of(phases, times, size))

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> Nodes:
        """The motion from time zero to the end of the mesh, where the mass stays.

        Raises:
            ValueError: an engine without a mesh, whose steps depend on the parameters.
        """
        if self.mesh is None:
            raise ValueError("A path of the smooth engine needs a mesh: make one with Smooth.meshed.")
        machine = Scaled.of(oscillator, start)
        motion, (x, v, states) = follow_mesh(_plain(oscillator), machine, machine.start(start), self.mesh)
        place, way = machine.settling(x, v, states)
        # The mesh was made for other coefficients, with which the way was shorter than here.
        sticks = way * machine.length < _MOVED * self.still
        position = jnp.where(sticks, place, x) * machine.length
        return eqx.tree_at(lambda n: (n.rest_position, n.finished), motion, (position, jnp.asarray(True)))

    def trail(self, oscillator: Oscillator, start: Start, duration: Float[Array, ""]) -> Nodes:
        """The motion at the ends of the steps that the error estimate chooses, up to `duration` [s].

        It ends earlier where `max_steps` are not enough; unused nodes repeat the last one.
        """
        machine = Scaled.of(oscillator, start)
        end = duration * machine.rate
        every = diffrax.SaveAt(t0=True, steps=True)
        solution = self._free(machine.start(start), _Args(machine), end, every, self.max_steps)
        last = jnp.sum(jnp.isfinite(solution.ts)) - 1
        made = jnp.minimum(jnp.arange(solution.ts.size), last)
        tau, (x, v, *states) = jax.tree.map(lambda values: values[made], (solution.ts, solution.ys))
        return machine.nodes(tau, x, v, tuple(states))

    def meshed(
        self, oscillator: Oscillator, start: Start, duration: Array, half_cycles: Array | None, capacity: int
    ) -> tuple[Array, Array]:
        """Phases and times of the steps that the error estimate chooses until `duration` [s], for `Mesh.of`.

        Beyond the last one of each list there is inf; not so where `capacity` steps do not lead to the end, and the
        list is full. The phases end at the last reversal, after `half_cycles` where these are known, and the times
        where the mass rests.
        """
        machine = Scaled.of(oscillator, start)
        tolerance, end = self._tolerance(machine), duration * machine.rate
        most = self.max_half_cycles
        limits = Limits(end, jnp.asarray(most if half_cycles is None else half_cycles), most)
        first = choose_phase_steps(_plain(oscillator), machine, machine.start(start), tolerance, limits, capacity)
        left = jnp.maximum(end - first.elapsed, 0.0)
        waiting = FieldArgs(machine, jnp.asarray(False))
        rests = _resting(field, tolerance, left, self.still / machine.length)
        solver, controller = self._chosen(
            machine, SwitchingSolver(_plain(oscillator), switching_quantities, after_switch)
        )
        settings = {"saveat": _ENDS, "stepsize_controller": controller, "max_steps": capacity}
        event = diffrax.Event(rests)
        then = integrate(field, solver, jnp.zeros(()), left, first.end, waiting, event=event, **settings)
        # Steps that were rejected count too; where most were, the motion grows without bound and needs no more of them.
        short = (then.result == diffrax.RESULTS.max_steps_reached) & jnp.isfinite(then.ts[capacity // 2])
        return first.phases, jnp.where(short & jnp.isinf(then.ts), left, then.ts)

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
        drive: Drive | None = None,
    ) -> Motion:
        machine, x, v, state, solution = self._integrate(oscillator, start, ts, drive)
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
            engine=self.name,
            result=RESULTS.promote(solution.result),
            stats={name: solution.stats[name] for name in self.counted},
        )

    def rest(self, oscillator: Oscillator, start: Start) -> Array:
        """Where the mass comes to rest [m]; NaN where it still moves after `max_steps` or ten thousand half-periods."""
        machine = Scaled.of(oscillator, start)
        # A contact may ring for thousands of swings, whose errors add up.
        fine = Smooth(self.accuracy / _FINER)
        rests = _resting(_field, fine._tolerance(machine), jnp.asarray(_LONG), self.still / machine.length)
        y0, end, one = machine.start(start), jnp.asarray(_LONG), diffrax.SaveAt(t1=True)
        solution = fine._free(y0, _Args(machine), end, one, self.max_steps, diffrax.Event(rests))
        x, v, *states = (values[-1] for values in solution.ys)
        place, way = machine.settling(x, v, tuple(states))
        position = jnp.where(way * machine.length < self.still, place, x) * machine.length
        return jnp.where(solution.result == diffrax.RESULTS.event_occurred, position, jnp.nan)

    def _integrate(self, oscillator: Oscillator, start: Start, ts: Array, drive: Drive | None) -> tuple:
        """The scaled machine, and displacement, velocity, internal states at `ts`, and the solution."""
        machine = Scaled.of(oscillator, start, drive)
        tau = jnp.maximum(ts, 0.0) * machine.rate
        args = _Args(machine, jnp.asarray(_SHOWS * self.accuracy / machine.length))
        y0 = machine.start(start)
        saved = diffrax.SaveAt(ts=tau, solver_state=True)
        most = self.max_half_cycles
        solution = self._free(y0, args, jnp.maximum(tau[-1], 1e-9), saved, self.max_steps, recorded=most)
        x, v = solution.ys[0] * machine.length, solution.ys[1] * machine.speed
        state = jnp.stack(solution.ys[2:], axis=-1) * machine.state if len(y0) > 2 else jnp.zeros((ts.shape[0], 0))
        a0 = _field(jnp.zeros(()), y0, args)[1] * machine.speed * machine.rate if drive is None else None
        return machine, *continued(ts, start, a0, x, v), state, solution

    def _free(
        self,
        y0: tuple,
        args: _Args,
        end: Array,
        saveat: Any,
        max_steps: int,
        event: Any = None,
        recorded: int | None = None,
    ) -> Any:
        """Integration in time with steps chosen by their error.

        With `recorded`, the length of the list, the solver keeps a log of the reversals.
        """
        method = self.method or _plain(args.machine.oscillator)
        solver, controller = self._chosen(args.machine, SwitchingSolver(method, _switching_quantities, _after_switch))
        settings = {"saveat": saveat, "stepsize_controller": controller, "max_steps": max_steps, "event": event}
        with_log = solver if recorded is None else ReversalRecorder(solver, recorded, _record)
        return integrate(_field, with_log, jnp.zeros(()), end, y0, args, **settings)

    def _chosen(self, machine: Scaled, switching: SwitchingSolver) -> tuple[diffrax.AbstractAdaptiveSolver, Any]:
        """Solver and controller in time; their steps end where the rates of a law with states have a kink."""
        tolerance = self._tolerance(machine)
        if self.method is not None:
            return switching, Cautious(rtol=tolerance, atol=tolerance)
        if not machine.oscillator.friction.n_states:
            return switching.solver, diffrax.PIDController(rtol=tolerance, atol=tolerance)
        return switching, SecantSteps(Cautious(rtol=tolerance, atol=tolerance), step_across(tolerance))

    def _tolerance(self, machine: Scaled) -> Array:
        # Over fifty half-cycles the errors of the steps add up to some thirty times the tolerance.
        return jnp.maximum(0.02 * self.accuracy / machine.length, 1e-14)


_ENDS = diffrax.SaveAt(t0=True, steps=True, fn=lambda t, y, args: None)


def _record(log: Log, before: tuple, behind: tuple, args: _Args) -> Log:
    """The log after a step, from time and state at both of its ends."""
    (t0, y0), (t1, y1) = before, behind
    ends = ((t, y[0], y[1], _field(t, y, args)[1], y[2:]) for t, y in ((t0, y0), (t1, y1)))
    return after_step(log, args.machine, args.shows, *ends)


def _resting(field: Callable, tolerance: Any, left: Any, still: Any) -> Callable[..., Array]:
    """An event: neither speed nor acceleration moves the mass any more, or the contact has all but stopped it.

    Args:
        field: the vector field of the motion in time.
        tolerance: that of the integration.
        left: scaled time in which a standing mass must not show that it moves.
        still: scaled way that a contact may still spring back and ring.
    """

    def rests(tau: Any, y: tuple, args: Any, **kwargs: Any) -> Array:
        _, way = args.machine.settling(y[0], y[1], y[2:])
        stands = (jnp.abs(y[1]) * (1 + left) < _STILL * tolerance) & (jnp.abs(field(tau, y, args)[1]) < tolerance)
        return stands | (way < still)

    return rests


def _plain(oscillator: Oscillator) -> diffrax.AbstractAdaptiveSolver:
    """The method that suits a law: implicit where it is stiff."""
    law = oscillator.friction
    return Rodas5P(modes=law.n_modes) if law.stiff else diffrax.Dopri8(scan_kind="lax")


def _switching_quantities(tau: Any, y: tuple, args: _Args) -> Array:
    """The velocity, and what else the law switches by."""
    return jnp.concatenate([jnp.reshape(y[1], (1,)), args.machine.switches(y[1], y[2:])])


def _after_switch(tau: Any, y: tuple, before: tuple, args: _Args) -> tuple:
    """The scaled state from which the next step begins."""
    return (*y[:2], *args.machine.mapped(y[0], y[1], y[2:], before[2:]))
