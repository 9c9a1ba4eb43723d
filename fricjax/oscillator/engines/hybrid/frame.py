"""The half-cycle in phase angle: its frame and its equation of motion.

In each half-cycle the motion is written as a swing about the centre that friction has shifted, ``x = s (x_d + A cos
theta)``, ``v = -s omega A sin theta``, where ``s`` is the side of the turning point, ``x_d = F_ref/k_ref`` and
``omega^2 = k_ref/m`` with the secant stiffness ``k_ref = R(y)/y`` there. Where a spring has a coordinate q in which
its energy is that of a linear one, as a pendulum has, q stands for x, and ``theta`` runs slower by ``dq/dx``. Amplitude
and time are then slow functions of the phase, driven only by what is not the reference spring and the reference
friction (variation of parameters), and the next reversal lies at ``theta = pi`` whatever the parameters. The reference
friction is the force as sliding begins; for a regularised law that of the set-valued law that it stands for.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array

from ...oscillator import Oscillator
from ..elementary import once, rotation

# Largest change of the logarithms of phase rate and amplitude from node to node, together: beyond it the interpolation
# between nodes is not trusted to follow the motion. Chosen, not derived.
_LARGEST_LEAP = 0.6


class Frame(NamedTuple):
    """Side of the turning point, angular frequency and stiffness of the reference spring, and the dead band.

    The dead band, like all amplitudes, counts in the stretched coordinate of the spring.
    """

    side: Array
    angular_frequency: Array
    stiffness: Array
    dead_band: Array


class Angle(NamedTuple):
    """Cosine and sine of phases of a half-cycle."""

    cosine: Array
    sine: Array

    @classmethod
    def of(cls, theta: Array) -> "Angle":
        return cls(*once(rotation(theta)))

    def at(self, index: Any) -> "Angle":
        """Those of some of the phases, as an array is indexed."""
        return Angle(self.cosine[index], self.sine[index])


def frame_at(oscillator: Oscillator, side: Array, x: Array) -> Frame:
    """The frame of a half-cycle whose largest deflection is `x` [m].

    The secant stiffness changes with each half-cycle, so that what is left of the spring as a disturbance is small at
    every amplitude of a decay.
    """
    stiffness = oscillator.restoring.reference(x, oscillator.stiffness)
    return Frame(side, jnp.sqrt(stiffness / oscillator.mass), stiffness, reference_force(oscillator) / stiffness)


def reference_force(oscillator: Oscillator) -> Array:
    """Friction force as sliding begins [N], without the regularisation."""
    return oscillator.friction.set_valued_limit().sliding_force(jnp.zeros(()), oscillator.normal_force)  # pyright: ignore[reportReturnType]


def side_of(turning_point: Array) -> Array:
    """The side on which a mass stands still, +1 at the equilibrium itself."""
    return jnp.where(turning_point < 0, -1.0, 1.0)


class Place(NamedTuple):
    """Displacement [m] with its stretched coordinate, the slope of that, and the speed [m/s]."""

    x: Array
    stretched: Array
    slope: Any
    speed: Array


def amplitude_at(oscillator: Oscillator, frame: Frame, turning_point: Array) -> Array:
    """Amplitude of a half-cycle at the turning point from which it starts."""
    return frame.side * oscillator.restoring.stretched(turning_point) - frame.dead_band


def reversal_position(oscillator: Oscillator, frame: Frame, amplitude: Array) -> Array:
    """The turning point at which a half-cycle ends with this amplitude [m]."""
    return oscillator.restoring.unstretched(frame.side * (frame.dead_band - amplitude))[0]


def place(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> Place:
    """Where the mass is at a phase."""
    q = frame.side * (frame.dead_band + amplitude * angle.cosine)
    x, slope = oscillator.restoring.unstretched(q)
    return Place(x, q, slope, frame.angular_frequency * amplitude * angle.sine)


def disturbance(oscillator: Oscillator, frame: Frame, at: Place) -> Array:
    """What is neither the reference spring nor the reference friction, per unit mass [m/s^2]."""
    friction = oscillator.friction.sliding_force(at.speed, oscillator.normal_force)
    spring = oscillator.restoring.remainder(at.x, frame.stiffness, oscillator.stiffness)
    resisting = oscillator.dissipation(at.speed) + oscillator.hysteresis(at.x) + friction
    rest = resisting - frame.stiffness * frame.dead_band * at.slope
    return (rest - frame.side * spring) / oscillator.mass


def phase_rates(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Array]:
    """dA/dtheta and dt/dtheta."""
    push, slope = _push(oscillator, frame, amplitude, angle)
    lapse = 1 / (frame.angular_frequency * slope - push * angle.cosine / amplitude)
    return -push * angle.sine * lapse, lapse


def _push(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Any]:
    """The disturbance over the angular frequency, and the slope of the stretched coordinate."""
    at = place(oscillator, frame, amplitude, angle)
    return disturbance(oscillator, frame, at) / frame.angular_frequency, at.slope


def is_resolved(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle, slowest: float = 0.1) -> Array:
    """Whether the phase has run forwards through all nodes, without a leap of its rate or of the amplitude.

    `slowest` is the smallest rate of the phase that will do, as a fraction of that without any disturbance.
    """
    push, slope = _push(oscillator, frame, amplitude, angle)
    rate = 1 - push * angle.cosine / (amplitude * frame.angular_frequency * slope)
    steady = jnp.abs(jnp.diff(jnp.log(rate))) + jnp.abs(jnp.diff(jnp.log(jnp.abs(amplitude)))) < _LARGEST_LEAP
    return jnp.all(rate > slowest) & jnp.all(steady)


def motion_at(oscillator: Oscillator, frame: Frame, amplitude: Array, angle: Angle) -> tuple[Array, Array, Array]:
    """Displacement, velocity and acceleration at a phase, the acceleration from the equation of motion."""
    at = place(oscillator, frame, amplitude, angle)
    push = disturbance(oscillator, frame, at)
    pull = frame.angular_frequency**2 * at.slope * (at.stretched - frame.side * frame.dead_band)
    return at.x, -frame.side * at.speed, frame.side * push - pull
