"""Integration of set-valued friction in time by diffrax with events.

Within one direction of sliding the equation of motion is smooth. diffrax integrates until the velocity vanishes; its
root finder locates that instant on the dense output of the last step. The mass sticks if the net pull does not exceed
the static friction force; otherwise it slides in the direction of the pull. A sticking mass is held until the pull
exceeds that force, which is another event. No step crosses a jump.

The method makes no assumption about the phase or the shape of half-cycles. It therefore serves as the reference for
free motions, and as the engine for driven motions.
"""

from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Drive, Oscillator
from ..outcome import RESULTS
from .base import AbstractEngine, AbstractPath, Demands
from .smooth.scaled import Scaled, continued

# Tolerance of a step relative to the accuracy. Errors accumulate over steps, and samples come from the dense output,
# which has no error control. At ten times this value the error of a typical decay is a tenth of the accuracy.
_SHARE = 0.002
_FINEST = 1e-14
# Samples per integration; without a bound, each of thousands of half-cycles would process all samples.
_WINDOW = 512


class _Phase(NamedTuple):
    """Scaled state at the start of a slide or rest, with samples.

    `direction` is +1 or -1, or 0 for a sticking mass. `slid` is True once the mass has moved; before that the contact
    holds its breakaway force.
    """

    tau: Array
    x: Array
    v: Array
    direction: Array
    slid: Array
    count: Array
    points: Array
    stopped: Array
    xs: Array
    vs: Array
    directions: Array
    phases: Array
    steps: Array
    result: Any


class _Machine(eqx.Module):
    """Oscillator in scaled units, with the condition for sticking."""

    scaled: Scaled

    def pull(self, tau: Array, x: Array) -> Array:
        """Return the net force towards negative x that friction must balance [N]."""
        return self.scaled.pull(x) - self.scaled.push(tau)

    def excess(self, tau: Array, x: Array, slid: Array) -> Array:
        """Return the holding force minus the pull, relative to the spring's force."""
        oscillator, length = self.scaled.oscillator, self.scaled.length
        law, load = oscillator.friction, oscillator.normal_force
        contact = jnp.where(slid, law.static_force(load), law.breakaway_force(load))
        most = contact + oscillator.hysteresis(x * length)
        return (most - jnp.abs(self.pull(tau, x))) / (oscillator.stiffness * length)

    def onward(self, tau: Array, x: Array, slid: Array) -> Array:
        """Return the direction after zero velocity; 0 if static friction holds."""
        spare = self.excess(tau, x, slid)
        # Without friction a moving floor leaves no mass at rest, though the pull may vanish for an instant.
        leaves = (spare < 0) | ((spare == 0) & (self.scaled.floor is not None))
        return jnp.where(leaves, self.away(tau, x), 0.0)

    def away(self, tau: Array, x: Array) -> Array:
        """Return the direction in which the pull moves the mass."""
        return jnp.where(self.pull(tau, x) > 0, -1.0, 1.0)


class _Args(NamedTuple):
    machine: _Machine
    direction: Array
    slid: Array
    begin: Array


def _field(tau: Any, y: tuple, args: _Args) -> tuple:
    """Return the rates of scaled displacement and velocity during one phase."""
    scaled, oscillator = args.machine.scaled, args.machine.scaled.oscillator
    x, v = y[0] * scaled.length, y[1] * scaled.speed
    sliding = oscillator.friction.sliding_force(jnp.maximum(args.direction * v, 0.0), oscillator.normal_force)
    resisting = oscillator.dissipation(v) + args.direction * (sliding + oscillator.hysteresis(x))
    a = -(args.machine.pull(tau, y[0]) + resisting) / oscillator.mass
    moves = jnp.abs(args.direction)
    return moves * y[1], moves * a / (scaled.speed * scaled.rate)


def _ends(t: Any, y: tuple, args: _Args, **kwargs: Any) -> Array:
    """Return the quantity that vanishes at the end of a phase.

    It is the velocity of a slide and the spare holding force of a rest.
    """
    # The velocity also vanishes at the start of a slide, which is not its end.
    forward = jnp.where(t <= args.begin, 1.0, args.direction * y[1])
    return jnp.where(args.direction == 0, args.machine.excess(t, y[0], args.slid), forward)


class Events(AbstractEngine):
    """Alternating slides and rests, each integrated by diffrax up to its event.

    Attributes:
        accuracy: target for the largest error of the displacement [m].
        max_half_cycles: maximum number of turning points and slides; each slide may be followed by a rest.
        max_steps: maximum number of steps of one slide or rest.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> motion = fj.simulate(machine, 2e-3, np.linspace(0, 1, 11), engine=Events(accuracy=1e-10))
        >>> int(motion.n_half_cycles), bool(motion.at_rest[-1])
        (5, True)
    """

    name: ClassVar[str] = "diffrax"
    counted: ClassVar[tuple[str, ...]] = ("num_steps",)
    needs_mesh: ClassVar[bool] = False
    takes_drive: ClassVar[bool] = True
    accuracy: float | Float[Array | np.ndarray, ""] = 1e-10
    max_half_cycles: int = eqx.field(static=True, default=512)
    max_steps: int = eqx.field(static=True, default=100_000)

    @staticmethod
    def refusal(oscillator: Oscillator) -> str | None:
        if not oscillator.friction.set_valued:
            name = type(oscillator.friction).__name__
            return f"{name} has no jump at rest, at which slides and rests begin and end. Use the smooth engine."
        return None

    def tuned(self, oscillator: Oscillator, demands: Demands) -> "Events":
        return Events(np.asarray(demands.accuracy), self.max_half_cycles, self.max_steps)

    def finer(self) -> "Events":
        return Events(self.accuracy / 10, self.max_half_cycles, self.max_steps)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> AbstractPath:
        raise ValueError("The diffrax engine is a reference for simulations. Fit with another one, such as auto.")

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
        drive: Drive | None = None,
    ) -> Motion:
        scaled = Scaled.of(oscillator, start, drive)
        machine = _Machine(scaled)
        taus = jnp.maximum(ts, 0.0) * scaled.rate
        most = jnp.asarray(jnp.inf if half_cycles is None else half_cycles, float)
        end = jnp.maximum(taus[-1], 1e-9)
        # Each slide may be followed by a rest, and each may span several windows.
        most_phases = 2 * self.max_half_cycles + 2 * taus.size // _WINDOW + 2
        going = lambda at: (at.tau < end) & (at.phases < most_phases) & (at.count < self.max_half_cycles)
        begun = self._begun(machine, start, taus)
        last = jax.lax.while_loop(going, lambda at: self._next(machine, taus, end, most, at), begun)
        args = _Args(machine, begun.direction, begun.slid, begun.tau)
        a0 = _field(begun.tau, (begun.x, begun.v), args)[1] * scaled.speed * scaled.rate if drive is None else None
        x, v = continued(ts, start, a0, last.xs * scaled.length, last.vs * scaled.speed)
        load, direction = oscillator.normal_force, last.directions
        sliding = oscillator.friction.sliding_force(jnp.abs(v), load)
        balance = -jax.vmap(machine.pull)(taus, last.xs)
        at_rest, short = (direction == 0) | (ts < 0) & (drive is not None), last.tau < end
        return Motion(
            t=ts,
            x=x,
            v=v,
            friction_force=jnp.where(at_rest, balance, direction * sliding),
            at_rest=at_rest,
            t_stop=jnp.where(drive is None, last.stopped, jnp.inf) / scaled.rate,
            turning_points=last.points * scaled.length,
            n_half_cycles=last.count,
            regularisation_bias=jnp.zeros(()),
            engine=self.name,
            result=RESULTS.where(short, RESULTS.too_many_half_cycles, last.result),
            stats={"num_steps": last.steps},
        )

    def _begun(self, machine: _Machine, start: Start, taus: Array) -> _Phase:
        x, v = start.x0 / machine.scaled.length, start.v0 / machine.scaled.speed
        zero, stood = jnp.zeros(()), jnp.asarray(False)
        direction = jnp.where(v == 0, machine.onward(zero, x, stood), jnp.sign(v))
        points = jnp.full(self.max_half_cycles + 1, jnp.nan).at[0].set(jnp.where(v == 0, x, jnp.nan))
        everywhere = jnp.zeros(taus.shape)
        stopped = jnp.where(direction == 0, 0.0, jnp.inf)
        none = jnp.zeros((), int)
        at = x + everywhere, v + everywhere, direction + everywhere
        return _Phase(zero, x, v, direction, direction != 0, none, points, stopped, *at, none, none, RESULTS.successful)

    def _next(self, machine: _Machine, taus: Array, end: Array, most: Array, at: _Phase) -> _Phase:
        """Integrate and sample one phase; return the next one."""
        tolerance = jnp.maximum(_SHARE * self.accuracy / machine.scaled.length, _FINEST)
        # An error of the root moves the next half-cycle only to second order. Newton's method fails for a slide that
        # ends within its first step, because the velocity vanishes at both ends.
        finder = optimistix.Bisection(rtol=1e-10, atol=1e-10)
        width = min(_WINDOW, taus.size)
        first = jnp.clip(jnp.searchsorted(taus, at.tau, side="right") - 1, 0, taus.size - width)
        window = jax.lax.dynamic_slice(taus, (first,), (width,))
        until = jnp.where(first + width == taus.size, end, window[-1])
        samples = diffrax.SubSaveAt(ts=jnp.clip(window, at.tau, until))
        controller: Any = diffrax.PIDController(rtol=tolerance, atol=tolerance)
        if machine.scaled.floor is not None:
            # The floor acceleration has a kink at each sample, and a step at rest could jump over a short slip.
            controller = diffrax.ClipStepSizeController(controller, step_ts=window)
        solution: Any = diffrax.diffeqsolve(
            diffrax.ODETerm(_field),
            # Samples and events use the dense output; that of Dopri8 is fifty times less accurate.
            diffrax.Tsit5(),
            at.tau,
            until,
            None,
            (at.x, at.v),
            _Args(machine, at.direction, at.slid, jnp.where(at.v == 0, at.tau, -jnp.inf)),
            saveat=diffrax.SaveAt(subs=[samples, diffrax.SubSaveAt(t1=True)]),
            stepsize_controller=controller,
            adjoint=diffrax.ForwardMode(),
            event=diffrax.Event(_ends, finder),
            max_steps=self.max_steps,
            throw=False,
        )
        tau, (x, v) = solution.ts[1][-1], (part[-1] for part in solution.ys[1])
        failed = (solution.result != diffrax.RESULTS.successful) & (solution.result != diffrax.RESULTS.event_occurred)
        ended = solution.result == diffrax.RESULTS.event_occurred
        moved = at.direction != 0
        count = at.count + (ended & moved)
        inside = (window >= at.tau) & (window <= tau)

        def sampled(so_far: Array, here: Any) -> Array:
            before = jax.lax.dynamic_slice(so_far, (first,), (width,))
            return jax.lax.dynamic_update_slice(so_far, jnp.where(inside, here, before), (first,))

        onward = jnp.where(count >= most, 0.0, machine.onward(tau, x, jnp.asarray(True)))
        # Rounding may leave the pull at the end of a rest just below the holding force.
        direction = jnp.where(ended, jnp.where(moved, onward, machine.away(tau, x)), at.direction)
        return _Phase(
            tau=jnp.where(failed, end, tau),
            x=x,
            v=jnp.where(ended, 0.0, v),
            direction=direction,
            slid=at.slid | moved,
            count=count,
            # Indices beyond the end are dropped; choosing between two lists would copy them at each half-cycle.
            points=at.points.at[jnp.where(ended & moved, count, at.points.size)].set(x, mode="drop"),
            stopped=jnp.where(ended, jnp.where(direction == 0, tau, jnp.inf), at.stopped),
            xs=sampled(at.xs, solution.ys[0][0]),
            vs=sampled(at.vs, solution.ys[0][1]),
            directions=sampled(at.directions, at.direction),
            phases=at.phases + 1,
            steps=at.steps + solution.stats["num_steps"],
            result=RESULTS.where(failed, RESULTS.promote(solution.result), at.result),
        )
