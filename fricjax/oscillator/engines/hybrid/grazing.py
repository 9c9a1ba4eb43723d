"""Half-cycles that barely leave rest, with a leaping phase.

If the pull only just exceeds the static force, the mass first creeps out of the dead band. As friction falls, it then
accelerates through most of the half-cycle. Such a half-cycle is integrated in time until the mass begins to slow down.
The rest is integrated in phase about the place of maximum speed. From there the phase always advances, so the reversal
is again at ``theta = pi`` without an event search.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...motion import Start
from ...oscillator import Oscillator
from ..nodes import Nodes
from .frame import Angle, frame_at, is_resolved, motion_at, reversal_position
from .half_cycles import Attempt, HalfCycle, RestCondition, Reversal, advance
from .phase_steps import integrate_phase, layer_width, mesh_fractions

# Maximum number of grazing half-cycles; they occur only just before rest.
MOST = 3
# Time steps until the mass slows down, and phase steps from there to the reversal.
_STEPS, _PHASES = 160, 32
# Number of nodes of all grazing half-cycles.
NODES = MOST * (_STEPS + 1 + _PHASES + 1)
# Upper limit for the layer of the mesh: under strong damping the phase about the fastest place ends slowly.
_THINNEST = 1e-3
_TOLERANCE, _ROUNDING = 3e-8, 1e-15
# Time limit; an unstable balance may take arbitrarily long to leave, so the event ends the integration.
_FOREVER = 1e9


class _Breakaway(NamedTuple):
    """Start on the side `side` with growing speed.

    The units are `length` and 1/`rate`.
    """

    oscillator: Oscillator
    side: Array
    start: Array
    length: Array
    rate: Array

    def field(self, _: Any, y: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return the rates of distance and speed."""
        return y[1], self.acceleration(*y)

    def acceleration(self, way: Array, speed: Array) -> Array:
        """Return the acceleration along the motion."""
        u = jnp.maximum(speed, 0.0) * self.length * self.rate
        x = self.side * (self.start - way * self.length)
        pull = self.side * self.oscillator.restoring_force(x) - self.oscillator.hysteresis(x)
        friction = self.oscillator.friction.sliding_force(u, self.oscillator.normal_force)
        force = pull - friction - self.oscillator.dissipation(u)
        return force / (self.oscillator.mass * self.length * self.rate**2)


def _break_away(mass: _Breakaway, speed: Array, needed: Array) -> tuple[Array, Array, Array, Array]:
    """Integrate until the mass slows down.

    Returns:
        Time, distance and speed at the ends of the steps, and whether the mass slows down within them.
    """
    import diffrax

    slowing = diffrax.Event(lambda t, y, args, **_: args.acceleration(*y) < 0)
    begin = (jnp.zeros_like(speed), speed)
    end = jnp.where(needed & (mass.acceleration(*begin) > 0), _FOREVER, 0.0)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: args.field(t, y)),
        diffrax.Tsit5(),
        jnp.zeros_like(end),
        end,
        None,
        begin,
        mass,
        saveat=diffrax.SaveAt(t0=True, steps=True),
        stepsize_controller=diffrax.PIDController(rtol=_TOLERANCE, atol=_ROUNDING),
        adjoint=diffrax.ForwardMode(),
        event=slowing,
        max_steps=_STEPS,
        throw=False,
    )
    made = jnp.sum(jnp.isfinite(solution.ts)) - 1  # pyright: ignore[reportArgumentType]
    kept = jnp.minimum(jnp.arange(_STEPS + 1), made)
    t, way, speed = (values[kept] for values in (solution.ts, *solution.ys))  # pyright: ignore
    return t, way, speed, mass.acceleration(way[-1], speed[-1]) <= 0


def _attempt(
    oscillator: Oscillator, x: Array, v: Array, reach: Array, theta: Float[Array, " nodes"], at: Reversal
) -> Attempt:
    """Integrate the half-cycle from displacement `x` and velocity `v`.

    `theta` are the phases of its nodes after the place of maximum speed.
    """
    side = jax.lax.stop_gradient(jnp.where(v == 0, jnp.where(x < 0, -1.0, 1.0), -jnp.sign(v)))
    frame = frame_at(oscillator, side, x)
    mass = _Breakaway(oscillator, side, side * x, reach, frame.angular_frequency)
    t, way, speed, slows = _break_away(mass, -side * v / (reach * frame.angular_frequency), ~at.finished)
    growth = jax.vmap(mass.acceleration)(way, speed) * reach * frame.angular_frequency**2
    first = HalfCycle(
        at.time + t / frame.angular_frequency,
        side * (mass.start - way * reach),
        -side * speed * reach * frame.angular_frequency,
        -side * growth,
    )
    frame = frame._replace(dead_band=side * oscillator.restoring.stretched(first.x[-1]))
    amplitudes, elapsed = integrate_phase(oscillator, frame, speed[-1] * reach, theta)
    angle = Angle.of(theta)
    second = HalfCycle(first.t[-1] + elapsed, *motion_at(oscillator, frame, amplitudes, angle))
    nodes = HalfCycle(*(jnp.concatenate(parts) for parts in zip(first, second, strict=True)))
    resolved = slows & is_resolved(oscillator, frame, amplitudes, angle, slowest=0.0)
    return nodes, reversal_position(oscillator, frame, amplitudes[-1]), resolved


def grazing_half_cycles(
    oscillator: Oscillator, start: Start, rests: RestCondition, begin: Reversal
) -> tuple[Nodes, Array, Reversal]:
    """Integrate the motion from an unresolved half-cycle to rest.

    Args:
        oscillator: with a set-valued law.
        start: state at time zero; its velocity applies to the first half-cycle.
        rests: condition for resting at a turning point.
        begin: reversal before that half-cycle; if it was resolved, no half-cycle is made.

    Returns:
        The nodes; the turning points, shape (MOST,), padded with NaN; and the final reversal.
    """
    reach = jax.lax.stop_gradient(jnp.abs(start.x0) + jnp.abs(start.v0) / oscillator.angular_frequency)
    layer = jnp.minimum(layer_width(oscillator, frame_at(oscillator, jnp.ones(()), reach), reach), _THINNEST)
    theta = jnp.pi * mesh_fractions(2 * _PHASES, layer)[_PHASES:]

    def step(at: Reversal, _: None) -> tuple[Reversal, tuple[HalfCycle, Array]]:
        v = jnp.where(at.count == 0, start.v0, 0.0)
        return advance(at, *_attempt(oscillator, at.turning_point, v, reach, theta, at), rests)

    opened = begin._replace(finished=begin.resolved, resolved=jnp.asarray(True))
    end, (made, points) = jax.lax.scan(step, opened, length=MOST)
    columns = (values.reshape(-1) for values in made)
    return Nodes.of(columns, end.turning_point, end.time, end.at_rest), points, end
