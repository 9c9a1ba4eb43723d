"""Frame and equation of motion of a half-cycle in phase angle.

In each half-cycle the motion is an oscillation about the centre shifted by friction, ``x = s (x_d + A cos theta)``,
``v = -s omega A sin theta``. ``s`` is the side of the turning point, ``x_d = F_ref/k_ref`` and ``omega^2 = k_ref/m``
with the secant stiffness ``k_ref = R(y)/y`` there. If a spring has a coordinate q in which its energy is that of a
linear one, as for a pendulum, q replaces x, and ``theta`` advances slower by the factor ``dq/dx``. Amplitude and time
are then slow functions of the phase, driven only by deviations from the reference spring and the reference friction
(variation of parameters). The next reversal is at ``theta = pi`` for all parameters. The reference friction is the
force at the onset of sliding; for a regularised law, that of its set-valued limit.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ...oscillator import Oscillator
from ..elementary import once, rotation

# Largest change of the logarithms of phase rate and amplitude between nodes, together; beyond it the interpolation may
# not follow the motion. Chosen, not derived.
_LARGEST_LEAP = 0.6


class Frame(NamedTuple):
    """Side of the turning point, reference spring and dead band.

    The dead band and all amplitudes are in the stretched coordinate of the spring.
    """

    side: Array
    angular_frequency: Array
    stiffness: Array
    dead_band: Array


class Angle(NamedTuple):
    """Cosine and sine of phases in a half-cycle."""

    cosine: Array
    sine: Array

    @classmethod
    def of(cls, theta: Array) -> "Angle":
        return cls(*once(rotation(theta)))

    def at(self, index: Any) -> "Angle":
        """Select some of the phases by an array index."""
        return Angle(self.cosine[index], self.sine[index])


def frame_at(oscillator: Oscillator, side: Array, x: Array) -> Frame:
    """Return the frame of a half-cycle with the largest deflection `x` [m].

    The secant stiffness adapts to each half-cycle, so the remaining disturbance by the spring is small at every
    amplitude of a decay.
    """
    stiffness = oscillator.restoring.reference(x, oscillator.stiffness)
    return Frame(side, jnp.sqrt(stiffness / oscillator.mass), stiffness, reference_force(oscillator) / stiffness)


def reference_force(oscillator: Oscillator) -> Array:
    """Return the friction force at the onset of sliding [N], without regularisation."""
    return oscillator.friction.set_valued_limit().sliding_force(jnp.zeros(()), oscillator.normal_force)  # pyright: ignore[reportReturnType]


def side_of(turning_point: Array) -> Array:
    """Return the side of a mass at rest, +1 at the equilibrium."""
    return jnp.where(turning_point < 0, -1.0, 1.0)


class Place(NamedTuple):
    """Displacement [m], stretched coordinate, its slope, and speed [m/s]."""

    x: Array
    stretched: Array
    slope: Any
    speed: Array


def amplitude_at(oscillator: Oscillator, frame: Frame, turning_point: Array) -> Array:
    """Return the amplitude of a half-cycle that starts at the turning point."""
    return frame.side * oscillator.restoring.stretched(turning_point) - frame.dead_band


def reversal_position(oscillator: Oscillator, frame: Frame, amplitude: Array) -> Array:
    """Return the turning point at the end of a half-cycle [m]."""
    return oscillator.restoring.unstretched(frame.side * (frame.dead_band - amplitude))[0]


def place(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> Place:
    """Return the place of the mass at a phase."""
    q = frame.side * (frame.dead_band + amplitude * angle.cosine)
    x, slope = oscillator.restoring.unstretched(q)
    return Place(x, q, slope, frame.angular_frequency * amplitude * angle.sine)


def disturbance(oscillator: Oscillator, frame: Frame, at: Place) -> Array:
    """Return the force beyond reference spring and friction, per unit mass [m/s^2]."""
    friction = oscillator.friction.sliding_force(at.speed, oscillator.normal_force)
    spring = oscillator.restoring.remainder(at.x, frame.stiffness, oscillator.stiffness)
    resisting = oscillator.dissipation(at.speed) + oscillator.hysteresis(at.x) + friction
    rest = resisting - frame.stiffness * frame.dead_band * at.slope
    return (rest - frame.side * spring) / oscillator.mass


def phase_rates(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Array]:
    """Return dA/dtheta and dt/dtheta."""
    push, slope = _push(oscillator, frame, amplitude, angle)
    lapse = 1 / (frame.angular_frequency * slope - push * angle.cosine / amplitude)
    return -push * angle.sine * lapse, lapse


def _push(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Any]:
    """Return disturbance over angular frequency, and slope of the stretched coordinate."""
    at = place(oscillator, frame, amplitude, angle)
    return disturbance(oscillator, frame, at) / frame.angular_frequency, at.slope


def is_resolved(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle, slowest: float = 0.1) -> Array:
    """Return True if the phase advances steadily through all nodes.

    Neither its rate nor the amplitude may leap. `slowest` is the smallest allowed rate of the phase relative to the
    undisturbed rate.
    """
    push, slope = _push(oscillator, frame, amplitude, angle)
    rate = 1 - push * angle.cosine / (amplitude * frame.angular_frequency * slope)
    steady = jnp.abs(jnp.diff(jnp.log(rate))) + jnp.abs(jnp.diff(jnp.log(jnp.abs(amplitude)))) < _LARGEST_LEAP
    return jnp.all(rate > slowest) & jnp.all(steady)


def motion_at(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Array, Array]:
    """Return displacement, velocity and acceleration at a phase.

    The acceleration follows from the equation of motion.
    """
    at = place(oscillator, frame, amplitude, angle)
    push = disturbance(oscillator, frame, at)
    pull = frame.angular_frequency**2 * at.slope * (at.stretched - frame.side * frame.dead_band)
    return at.x, -frame.side * at.speed, frame.side * push - pull
