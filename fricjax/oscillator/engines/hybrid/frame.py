"""The half-cycle in phase angle: its frame, its equation of motion, and the mesh on which that is integrated.

In each half-cycle the motion is written as a swing about the centre that friction has shifted, ``x = s (x_d + A cos
theta)``, ``v = -s omega A sin theta``, where ``s`` is the side of the turning point, ``x_d = F_ref/k_ref`` and
``omega^2 = k_ref/m`` with the secant stiffness ``k_ref = R(y)/y`` there. Where a spring has a coordinate q in which
its energy is that of a linear one, as a pendulum has, q stands for x, and ``theta`` runs slower by ``dq/dx``. Amplitude
and time are then slow functions of the phase, driven only by what is not the reference spring and the reference
friction (variation of parameters), and the next reversal lies at ``theta = pi`` whatever the parameters. The reference
friction is the force as sliding begins; for a regularised law that of the set-valued law that it stands for.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...oscillator import Oscillator
from ..elementary import once, rotation

_LARGEST_LEAP = 0.6
_LOGARITHMIC_SHARE = 0.6
_NEWTON_STEPS = 24
# Slope of the stretched coordinate at which a turning point counts as the unstable equilibrium itself.
_STEEPEST = 1e-6


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
    """The frame of a half-cycle whose largest deflection is `x` [m]."""
    stiffness = oscillator.restoring.reference(x, oscillator.stiffness)
    return Frame(side, jnp.sqrt(stiffness / oscillator.mass), stiffness, reference_force(oscillator) / stiffness)


def reference_force(oscillator: Oscillator) -> Array:
    """Friction force as sliding begins [N], without the regularisation."""
    return oscillator.friction.set_valued_limit().sliding_force(jnp.zeros(()), oscillator.normal_force)  # pyright: ignore[reportReturnType]


class Place(NamedTuple):
    """Displacement [m] with its stretched coordinate, the slope of that, and the speed [m/s]."""

    x: Array
    stretched: Array
    slope: Any
    speed: Array


def amplitude_at(oscillator: Oscillator, frame: Frame, turning_point: Array) -> Array:
    """Amplitude of a half-cycle at the turning point from which it starts."""
    return frame.side * oscillator.restoring.stretched(turning_point) - frame.dead_band


def turned_at(oscillator: Oscillator, frame: Frame, amplitude: Array) -> Array:
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


def phases(frame: Frame, passing: Array | None, begin: Array, fractions: Array) -> Array:
    """Phases of the nodes of a half-cycle from the phase `begin` on, shape (nodes,).

    The middle node lies in the middle. Where the internal friction of a spring has a kink at the equilibrium, it lies
    there; `passing` is the amplitude with which the mass passes it.
    """
    middle = (begin + jnp.pi) / 2
    if passing is not None:
        there = jnp.arccos(jnp.clip(-frame.dead_band / passing, -1.0, 1.0))
        middle = jnp.where((begin < there) & (passing > frame.dead_band), there, middle)
    late = jnp.maximum(2 * fractions - 1, 0.0)
    return begin + (middle - begin) * jnp.minimum(2 * fractions, 1.0) + (jnp.pi - middle) * late


def mesh_fractions(steps: int, layer: Array, skew: Any = 0.0) -> Float[Array, " nodes"]:
    """Fractions of a half-cycle at which its steps end, crowded at both ends where the law changes fast.

    Args:
        steps: number of steps, even.
        layer: width of the layer at the reversals [rad], inf for none.
        skew: part by which the mesh is denser at the reversals than that.

    The mesh has steps proportional to the distance from the layer near the reversals, and even ones in the middle: in
    ``share ln(1 + theta/layer)/ln(1 + pi/(2 layer)) + (1 - share) 2 theta/pi`` its points are equidistant.
    """
    theta, _ = phase_of(jnp.linspace(0.0, 1.0, steps // 2 + 1), layer, skew)
    first = jnp.clip(theta / jnp.pi, 0.0, 0.5).at[-1].set(0.5)
    return jnp.concatenate([first, 1 - first[-2::-1]])


def phase_of(place: Array, layer: Array, skew: Any = 0.0) -> tuple[Array, Array]:
    """Phase in the first half of a half-cycle at a `place` between 0 and 1 in the mesh, and its slope there."""
    half = jnp.pi / 2
    rank, by_place = place - skew * jnp.sin(jnp.pi * place) / jnp.pi, 1 - skew * jnp.cos(jnp.pi * place)
    width = jax.lax.stop_gradient(jnp.clip(layer, 1e-9, 1e3))
    span = jnp.log1p(half / width)

    def rise(theta: Array) -> Array:
        return _LOGARITHMIC_SHARE / (span * (width + theta)) + (1 - _LOGARITHMIC_SHARE) / half

    def closer(_: Any, theta: Array) -> Array:
        # The rank is concave in theta, so that Newton's steps approach from below without overshooting.
        value = _LOGARITHMIC_SHARE * jnp.log1p(theta / width) / span + (1 - _LOGARITHMIC_SHARE) * theta / half
        return theta + (rank - value) / rise(theta)

    theta = jax.lax.fori_loop(0, _NEWTON_STEPS, closer, jnp.zeros_like(rank))
    return theta, by_place / rise(theta)


def layer_width(oscillator: Oscillator, frame: Frame, amplitude: Array) -> Array:
    """Phase in which the velocity leaves the range where the friction force changes fast [rad]."""
    speed = oscillator.friction.velocity_scale()
    return speed / (frame.angular_frequency * jnp.maximum(amplitude, jnp.finfo(float).tiny))


def separatrix_width(oscillator: Oscillator, amplitude: Array) -> Array:
    """Phase in which a half-cycle leaves the neighbourhood of an unstable equilibrium [rad], inf for a linear spring.

    The lapse of time has its poles where the slope of the stretched coordinate vanishes. With the slope ``sqrt(1 - Q^2
    cos^2(theta)/4)`` of a pendulum they lie ``arccosh(2/Q)`` beside the reversals, which is the inverse hyperbolic
    tangent of the slope there. A slope above one belongs to a spring that stiffens, and has no poles on that side.
    """
    slope = jnp.asarray(oscillator.restoring.unstretched(amplitude)[1])
    # Beyond the separatrix there is no half-cycle; its mesh need only be one.
    return jnp.arctanh(jnp.where(slope > _STEEPEST, jnp.minimum(slope, 1.0), _STEEPEST))
