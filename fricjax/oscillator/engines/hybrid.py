"""Half-cycles in phase angle: set-valued friction with any sliding law, drag and restoring force.

In each half-cycle the motion is written as a swing about the centre that friction has shifted, ``x = s (x_d + A cos
theta)``, ``v = -s omega A sin theta``, where ``s`` is the side of the turning point, ``x_d = F(0+)/k_ref`` and
``omega^2 = k_ref/m`` with the secant stiffness ``k_ref = R(y)/y`` there. Amplitude and time are then slow functions
of the phase, driven only by what is not the reference spring and the reference friction (variation of parameters),
and the next reversal lies at ``theta = pi`` whatever the parameters. So there is no event to search, no jump to step
over, and the derivatives are those of the discrete solution itself. At each reversal the rest condition ``|R(y)| <=
F_s`` decides whether the mass moves on.
"""

from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..motion import Motion, Start
from ..oscillator import Oscillator
from ..results import RESULTS
from .base import AbstractEngine
from .hermite import sample_nodes


class _Stroke(NamedTuple):
    """The frame of one half-cycle."""

    side: Array
    angular_frequency: Array
    stiffness: Array
    dead_band: Array


class _Carry(NamedTuple):
    turning_point: Array
    time: Array
    finished: Array
    count: Array
    forward: Array


def _frame(oscillator: Oscillator, side: Array, x: Array) -> _Stroke:
    away = jnp.abs(x) > 0
    x_safe = jnp.where(away, x, 1.0)
    stiffness = jnp.where(away, oscillator.restoring_force(x_safe) / x_safe, oscillator.stiffness)
    reference = oscillator.friction.sliding_force(jnp.zeros(()), oscillator.normal_force)
    return _Stroke(side, jnp.sqrt(stiffness / oscillator.mass), stiffness, reference / stiffness)


def _disturbance(oscillator: Oscillator, stroke: _Stroke, x: Array, speed: Array) -> Array:
    """What is neither the reference spring nor the reference friction, per unit mass [m/s^2]."""
    friction = oscillator.friction.sliding_force(speed, oscillator.normal_force)
    spring = oscillator.restoring_force(x) - stroke.stiffness * x
    rest = oscillator.dissipation(speed) + friction - stroke.stiffness * stroke.dead_band
    return (rest - stroke.side * spring) / oscillator.mass


def _position(stroke: _Stroke, amplitude: Array, theta: Array) -> tuple[Array, Array]:
    """Displacement and speed at a phase."""
    x = stroke.side * (stroke.dead_band + amplitude * jnp.cos(theta))
    return x, stroke.angular_frequency * amplitude * jnp.sin(theta)


def _phase_rates(theta: Any, state: Any, args: tuple[Oscillator, _Stroke]) -> tuple[Array, Array]:
    """dA/dtheta and dt/dtheta."""
    oscillator, stroke = args
    amplitude, _ = state
    x, speed = _position(stroke, amplitude, theta)
    push = _disturbance(oscillator, stroke, x, speed) / stroke.angular_frequency
    rate = stroke.angular_frequency - push * jnp.cos(theta) / amplitude
    return -push * jnp.sin(theta) / rate, 1 / rate


class Hybrid(AbstractEngine):
    """Half-cycles in phase angle for set-valued laws.

    Attributes:
        nodes: steps per half-cycle; 32 keep the error below 0.15 nm on a 2 mm motion.
        grading: how strongly the steps crowd at the reversals (0: uniform), for laws that change fast at low speed.
        max_half_cycles: bound on the number of half-cycles; a motion with more ends with a code of its own.
    """

    nodes: int = 32
    grading: float = 2.0
    max_half_cycles: int = 512

    def refusal(self, oscillator: Oscillator) -> str | None:
        if not oscillator.friction.set_valued:
            return (
                "The hybrid engine integrates set-valued laws (Coulomb, Stribeck), and "
                f"{type(oscillator.friction).__name__} is none. Use the smooth engine."
            )
        return None

    def solve(
        self,
        oscillator: Oscillator,
        start: Start,
        ts: Float[Array, " samples"],
        half_cycles: Int[Array, ""] | None = None,
    ) -> Motion:
        first, theta0 = _first_stroke(oscillator, start)
        final, nodes, points = self._strokes(oscillator, start, first, theta0, half_cycles)
        x, v = sample_nodes(ts, nodes, final.turning_point, final.time, final.finished)
        at_rest = final.finished & (ts >= final.time)
        sliding = oscillator.friction_force(v, jnp.zeros(0))
        t_last = ts[-1] if ts.shape[0] else jnp.asarray(-jnp.inf)
        reached = final.forward & (final.finished | (ts <= final.time))
        short = ~final.finished & (t_last > final.time)
        done: Any = RESULTS.successful
        outcome = RESULTS.where(short, RESULTS.too_many_half_cycles, done)
        return Motion(
            t=ts,
            x=jnp.where(reached, x, jnp.nan),
            v=jnp.where(reached, v, jnp.nan),
            friction_force=jnp.where(at_rest, -oscillator.restoring_force(x), sliding),
            at_rest=at_rest,
            t_stop=jnp.where(final.finished, final.time, jnp.inf),
            turning_points=jnp.concatenate([jnp.reshape(start.x0, (1,)), points]),
            n_half_cycles=jnp.where(final.finished, final.count, -1),
            regularisation_bias=jnp.zeros(()),
            engine="hybrid",
            result=RESULTS.where(final.forward, outcome, RESULTS.phase_reversed),
            stats={"nodes_per_half_cycle": self.nodes},
        )

    def _mesh(self) -> np.ndarray:
        """Fractions of a half-cycle at which the steps end, crowded at both ends."""
        z = np.linspace(-1, 1, self.nodes + 1)
        graded = np.tanh(self.grading * z) / np.tanh(self.grading) if self.grading else z
        return (1 + graded) / 2

    def _integrate(self, oscillator: Oscillator, stroke: _Stroke, amplitude: Array, theta0: Array) -> tuple:
        """Amplitude and time at the nodes of one half-cycle that begins at phase `theta0`."""
        theta = theta0 + (jnp.pi - theta0) * self._mesh()
        amplitudes, elapsed = diffrax.diffeqsolve(
            diffrax.ODETerm(_phase_rates),
            diffrax.Dopri8(),
            theta[0],
            theta[-1],
            None,
            (amplitude, jnp.zeros(())),
            (oscillator, stroke),
            saveat=diffrax.SaveAt(t0=True, steps=True),
            stepsize_controller=diffrax.StepTo(theta),
            adjoint=diffrax.ForwardMode(),
            max_steps=self.nodes,
        ).ys  # pyright: ignore[reportGeneralTypeIssues, reportOptionalIterable]
        return theta, amplitudes, elapsed

    def _strokes(
        self, oscillator: Oscillator, start: Start, first: _Stroke, theta0: Array, half_cycles: Array | None
    ) -> tuple:
        static = oscillator.friction.static_force(oscillator.normal_force)
        moving = start.v0 != 0
        spare = jnp.abs(start.x0) + 2 * first.dead_band + jnp.abs(start.v0) / first.angular_frequency

        def rests(y: Array, count: Array) -> Array:
            held = jnp.abs(oscillator.restoring_force(y)) <= static
            return jnp.where(moving & (count == 0), False, held) if half_cycles is None else count >= half_cycles

        def stroke(carry: _Carry, index: Array) -> tuple[_Carry, tuple]:
            inside = moving & (index == 0)
            y = jnp.where(carry.finished, spare, carry.turning_point)
            side = jnp.where(inside, first.side, jnp.where(y < 0, -1.0, 1.0))
            frame = _frame(oscillator, side, jnp.where(inside, start.x0, y))
            offset, lag = side * y - frame.dead_band, start.v0 / frame.angular_frequency
            amplitude = jnp.where(inside, jnp.sqrt(jnp.where(inside, offset**2 + lag**2, 1.0)), offset)
            theta, amplitudes, elapsed = self._integrate(oscillator, frame, amplitude, jnp.where(inside, theta0, 0.0))
            x, speed = _position(frame, amplitudes, theta)
            push = _disturbance(oscillator, frame, x, speed)
            forward = jnp.all(jnp.diff(elapsed) > 0)
            a = side * push - frame.angular_frequency**2 * (x - side * frame.dead_band)
            last = carry.finished
            t = carry.time + jnp.where(last, 0.0, elapsed)
            turned = side * (frame.dead_band - amplitudes[-1])
            y_next = jnp.where(last, carry.turning_point, turned)
            count = carry.count + jnp.where(last, 0, 1)
            after = _Carry(y_next, t[-1], last | rests(y_next, count), count, carry.forward & (last | forward))
            nodes = (
                t,
                jnp.where(last, carry.turning_point, x),
                jnp.where(last, 0.0, -side * speed),
                jnp.where(last, 0.0, a),
            )
            return after, (nodes, jnp.where(last, jnp.nan, y_next))

        zero = jnp.zeros((), int)
        begin = _Carry(jnp.asarray(start.x0), jnp.zeros(()), rests(start.x0, zero), zero, jnp.asarray(True))
        final, (nodes, points) = jax.lax.scan(stroke, begin, jnp.arange(self.max_half_cycles))
        return final, nodes, points


def _first_stroke(oscillator: Oscillator, start: Start) -> tuple[_Stroke, Array]:
    """Frame and phase of a start inside a half-cycle; the phase is unused for a start from rest."""
    moving = start.v0 != 0
    side = jax.lax.stop_gradient(jnp.where(moving, -jnp.sign(start.v0), jnp.where(start.x0 < 0, -1.0, 1.0)))
    frame = _frame(oscillator, side, start.x0)
    offset = side * start.x0 - frame.dead_band
    lag = jnp.where(moving, -side * start.v0, 1.0) / frame.angular_frequency
    return frame, jnp.arctan2(lag, offset)
