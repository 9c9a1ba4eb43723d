"""Integration in time, for laws without a jump: bristle laws, regularised laws and their creep, driven motion.

State and time are scaled by the amplitude, the natural frequency and the law's own deflection, so that one tolerance
fits every component: with raw bristle deflections of a nanometre beside millimetres none does.

An adaptive integration is a rough function of its parameters, since each choice of steps has its own error. For a
fit the steps are found once and kept as a mesh in scaled time, that is in the phase of the half-cycles: the motion
is then a smooth function of every coefficient, and its derivatives are exactly those of the discrete solution.
"""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator
from ..release import AbstractRelease
from ..results import RESULTS
from ..rosenbrock import Rodas5P
from .base import AbstractEngine
from .closing import Closing
from .landing import Landing, last_step
from .nodes import Nodes
from .turning import turning_points

# At rest a contact of the rate-and-state kind is so stiff that a first step of ordinary size hardly moves the mass, and
# no error estimate of such a step sees that a true contact gives way. Behind a reversal the steps are small anyway.
_FIRST_STEP = 1e-9


class Drive(eqx.Module):
    """What moves the mass besides its own spring.

    Attributes:
        base_acceleration: acceleration of the floor at the sample times [m/s^2]; linear between them.
        release: law by which the force that held the mass decays.
    """

    base_acceleration: Float[Array, " samples"] | None = None
    release: AbstractRelease | None = None


class _Scales(eqx.Module):
    """Units in which the state is integrated."""

    length: Array
    rate: Array
    state: Array

    @classmethod
    def of(cls, oscillator: Oscillator, start: Start, floor: Array | None = None) -> "_Scales":
        rate = oscillator.angular_frequency
        reach = jnp.maximum(jnp.maximum(jnp.abs(start.x0), jnp.abs(start.v0) / rate), oscillator.dead_band)
        if floor is not None:
            reach = jnp.maximum(reach, jnp.max(jnp.abs(floor)) / rate**2)
        state = oscillator.friction.state_scale(oscillator.normal_force)
        tiny = jnp.finfo(float).tiny
        length = jnp.where(reach > 0, reach, 1.0)
        return cls(jax.lax.stop_gradient(length), rate, jax.lax.stop_gradient(jnp.maximum(state, tiny)))


def _field(tau: Any, y: Any, args: Any) -> tuple:
    """Rates of the scaled state (x, v, internal states...) in scaled time."""
    oscillator, scales, floor, release, hold = args
    x, v, t = y[0] * scales.length, y[1] * scales.length * scales.rate, tau / scales.rate
    state = jnp.stack(y[2:]) * scales.state if len(y) > 2 else jnp.zeros(0)
    a = oscillator.acceleration(x, v, state)
    if floor is not None:
        a = a - floor.evaluate(tau)
    if release is not None:
        a = a + release.force(t, hold) / oscillator.mass
    rates = oscillator.friction.rate(v, state, oscillator.normal_force) / (scales.state * scales.rate)
    return (y[1], a / (scales.length * scales.rate**2), *(rates[i] for i in range(len(y) - 2)))


class Smooth(AbstractEngine):
    """Integration in time with a Rosenbrock solver.

    Attributes:
        accuracy: largest error of the displacement aimed at [m].
        mesh: ends of the steps in scaled time omega t; None lets the error estimate choose them.
        max_steps: bound on the number of steps.
        max_half_cycles: length of the list of turning points.
    """

    accuracy: float | Float[Array, ""] = 1e-10
    mesh: Float[Array, " steps"] | None = None
    max_steps: int = eqx.field(static=True, default=1_000_000)
    max_half_cycles: int = eqx.field(static=True, default=512)

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

    def finer(self) -> "Smooth":
        return Smooth(self.accuracy / 10, None, self.max_steps, self.max_half_cycles)

    def path(self, oscillator: Oscillator, start: Start, half_cycles: Int[Array, ""] | None = None) -> Nodes:
        """The motion from time zero to the end of the mesh.

        Raises:
            ValueError: an engine without a mesh, whose steps depend on the parameters.
        """
        if self.mesh is None:
            raise ValueError("A path of the smooth engine needs a mesh: make one with Smooth.steps.")
        args = _undriven(oscillator, start)
        saveat = diffrax.SaveAt(t0=True, steps=True)
        solution = self._solve(_scaled(start, args[1]), args, self.mesh[-1], saveat, self.mesh.size - 1)
        return _nodes(self.mesh, solution.ys, args)

    def trail(self, oscillator: Oscillator, start: Start, duration: Float[Array, ""]) -> Nodes:
        """The motion at the ends of the steps that the error estimate chooses, up to `duration` [s].

        It ends earlier where `max_steps` are not enough; unused nodes repeat the last one.
        """
        args = _undriven(oscillator, start)
        saveat = diffrax.SaveAt(t0=True, steps=True)
        solution = self._solve(_scaled(start, args[1]), args, duration * args[1].rate, saveat, self.max_steps)
        made = jnp.sum(jnp.isfinite(solution.ts)) - 1
        kept = jnp.minimum(jnp.arange(self.max_steps + 1), made)
        return _nodes(solution.ts[kept], jax.tree.map(lambda values: values[kept], solution.ys), args)

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
        drive: Drive | None = None,
    ) -> Motion:
        x, v, state, solution = self._integrate(oscillator, start, ts, drive or Drive())
        load = oscillator.normal_force
        friction = jax.vmap(lambda speed, z: oscillator.friction.force(speed, z, load))(v, state)
        points, count = turning_points(ts, x, v, start.x0, self.max_half_cycles)
        return Motion(
            t=ts,
            x=x,
            v=v,
            friction_force=friction,
            at_rest=jnp.zeros(ts.shape, bool),
            t_stop=jnp.asarray(jnp.inf),
            turning_points=points,
            n_half_cycles=count,
            regularisation_bias=jnp.zeros(()),
            engine="smooth",
            result=RESULTS.promote(solution.result),
            stats={name: solution.stats[name] for name in ("num_steps", "num_rejected_steps")},
        )

    def _integrate(self, oscillator: Oscillator, start: Start, ts: Array, drive: Drive) -> tuple:
        """Displacement, velocity and internal states at `ts`; before time zero a parabola continues the motion."""
        floor = drive.base_acceleration
        scales = _Scales.of(oscillator, start, floor)
        tau = jnp.maximum(ts, 0.0) * scales.rate
        path = None if floor is None else diffrax.LinearInterpolation(ts * scales.rate, floor)
        args = (oscillator, scales, path, drive.release, oscillator.restoring_force(start.x0))
        y0 = _scaled(start, scales)
        end = jnp.maximum(tau[-1], 1e-9) if self.mesh is None else self.mesh[-1]
        solution = self._solve(y0, args, end, diffrax.SaveAt(ts=jnp.minimum(tau, end)), self.max_steps)
        x, v = solution.ys[0] * scales.length, solution.ys[1] * scales.length * scales.rate
        state = jnp.stack(solution.ys[2:], axis=-1) * scales.state if len(y0) > 2 else jnp.zeros((ts.shape[0], 0))
        a0 = _field(jnp.zeros(()), y0, args)[1] * scales.length * scales.rate**2
        early = jnp.minimum(ts, 0.0)
        return x + early * (start.v0 + early * a0 / 2), v + early * a0, state, solution

    def _solve(self, y0: tuple, args: tuple, end: Array, saveat: diffrax.SaveAt, max_steps: int) -> Any:
        first, controller = self._stepping(args)
        return diffrax.diffeqsolve(
            diffrax.ODETerm(_field),
            _solver(args[0]),
            jnp.zeros(()),
            end,
            first,
            y0,
            args,
            saveat=saveat,
            stepsize_controller=controller,
            adjoint=diffrax.ForwardMode(),
            max_steps=max_steps,
            throw=False,
        )

    def _stepping(self, args: tuple) -> tuple[float | None, Any]:
        """The first step, None for the solver's own choice, and what chooses the others."""
        if self.mesh is not None:
            return None, diffrax.StepTo(self.mesh)
        # Over fifty half-cycles the errors of the steps add up to some thirty times the tolerance.
        tolerance = jnp.maximum(0.02 * self.accuracy / args[1].length, 1e-14)
        chosen = diffrax.PIDController(rtol=tolerance, atol=tolerance)
        if not args[0].friction.n_states:
            return None, chosen
        return _FIRST_STEP, Closing(chosen, last_step(tolerance))

    def steps(self, oscillator: Oscillator, start: Start, duration: Array, capacity: int) -> Float[Array, " steps"]:
        """Ends of the steps that the error estimate chooses, in scaled time, inf beyond the last one."""
        args = _undriven(oscillator, start)
        saveat = diffrax.SaveAt(t0=True, steps=True, fn=lambda t, y, args: None)
        return self._solve(_scaled(start, args[1]), args, duration * args[1].rate, saveat, capacity).ts


def _solver(oscillator: Oscillator) -> diffrax.AbstractAdaptiveSolver:
    """The method that suits a law: implicit where it is stiff, and with steps that end where its rates have a kink."""
    law = oscillator.friction
    plain = Rodas5P() if law.stiff else diffrax.Dopri8(scan_kind="lax")
    return Landing(plain, _watched, _returned) if law.n_states else plain


def _watched(y: tuple, args: tuple) -> Array:
    """The velocity, and what else the law switches by."""
    oscillator, scales = args[:2]
    v = y[1] * scales.length * scales.rate
    switches = oscillator.friction.switches(v, jnp.stack(y[2:]) * scales.state, oscillator.normal_force)
    return jnp.concatenate([jnp.reshape(y[1], (1,)), switches])


def _returned(tau: Any, y: tuple, args: tuple) -> tuple:
    """The scaled state from which the next step begins."""
    oscillator, scales = args[:2]
    speed, state = scales.length * scales.rate, jnp.stack(y[2:]) * scales.state
    v, a = y[1] * speed, _field(tau, y, args)[1] * speed * scales.rate
    kept = oscillator.friction.return_map(v, a, state, oscillator.normal_force) / scales.state
    return (y[0], y[1], *kept)


def _undriven(oscillator: Oscillator, start: Start) -> tuple:
    return oscillator, _Scales.of(oscillator, start), None, None, oscillator.restoring_force(start.x0)


def _nodes(tau: Array, ys: tuple, args: tuple) -> Nodes:
    """Nodes at scaled times `tau` from the scaled states there; the motion goes on behind the last one."""
    scales: _Scales = args[1]
    speed = scales.length * scales.rate
    a = jax.vmap(lambda at, y: _field(at, y, args)[1])(tau, ys) * speed * scales.rate
    t, x, v = tau / scales.rate, ys[0] * scales.length, ys[1] * speed
    return Nodes(t, x, v, a, rest_position=x[-1], t_stop=t[-1], finished=jnp.asarray(False))


def _scaled(start: Start, scales: _Scales) -> tuple:
    y0 = (start.x0 / scales.length, start.v0 / (scales.length * scales.rate), *(start.state / scales.state))
    return jax.tree.map(jnp.asarray, y0)
