"""Mesh of a half-cycle in phase, and eighth-order Runge-Kutta steps on it.

The method is that of Prince and Dormand (1981). The phases of all stages are known in advance, so their sines and
cosines are computed together. Time follows from the amplitude without feedback, so it only requires a quadrature.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...oscillator import Oscillator
from ..elementary import once
from .frame import Angle, Frame, phase_rates

# Part of the points spread evenly over the logarithm of the distance from the layer; the rest is even in phase, so
# steps in the middle stay short for any layer. Chosen, not derived.
_LOGARITHMIC_SHARE = 0.6
# Newton steps from the reversal; thirteen reach rounding for the thinnest layer, 1e-9 rad.
_NEWTON_STEPS = 24
# Slope of the stretched coordinate below which a turning point is regarded as the unstable equilibrium.
_STEEPEST = 1e-6

_Pair = tuple[Array, Array]


def phases(frame: Frame, passing: Array | None, begin: Array, fractions: Array) -> Array:
    """Return the phases of a half-cycle's nodes from `begin`, shape (nodes,).

    The middle node lies in the middle. For a spring with internal friction it lies on the kink at the equilibrium;
    `passing` is the amplitude at which the mass passes it.
    """
    middle = (begin + jnp.pi) / 2
    if passing is not None:
        there = jnp.arccos(jnp.clip(-frame.dead_band / passing, -1.0, 1.0))
        middle = jnp.where((begin < there) & (passing > frame.dead_band), there, middle)
    late = jnp.maximum(2 * fractions - 1, 0.0)
    return begin + (middle - begin) * jnp.minimum(2 * fractions, 1.0) + (jnp.pi - middle) * late


def mesh_fractions(steps: int, layer: Array, skew: Any = 0.0) -> Float[Array, " nodes"]:
    """Return step ends as fractions of a half-cycle, dense at both ends.

    Near the reversals the friction force changes fast.

    Args:
        steps: number of steps, even.
        layer: width of the layer at the reversals [rad], inf for none.
        skew: relative increase of the density at the reversals.

    Steps are proportional to the distance from the layer near the reversals, and even in the middle: the points are
    equidistant in ``share ln(1 + theta/layer)/ln(1 + pi/(2 layer)) + (1 - share) 2 theta/pi``.
    """
    theta, _ = phase_of(jnp.linspace(0.0, 1.0, steps // 2 + 1), layer, skew)
    first = jnp.clip(theta / jnp.pi, 0.0, 0.5).at[-1].set(0.5)
    return jnp.concatenate([first, 1 - first[-2::-1]])


def phase_of(place: Array, layer: Array, skew: Any = 0.0) -> tuple[Array, Array]:
    """Return the phase, and its slope, at a `place` in the mesh.

    `place` runs from 0 to 1 over the first half of a half-cycle.
    """
    half = jnp.pi / 2
    rank, by_place = place - skew * jnp.sin(jnp.pi * place) / jnp.pi, 1 - skew * jnp.cos(jnp.pi * place)
    width = jax.lax.stop_gradient(jnp.clip(layer, 1e-9, 1e3))
    span = jnp.log1p(half / width)

    def rise(theta: Array) -> Array:
        return _LOGARITHMIC_SHARE / (span * (width + theta)) + (1 - _LOGARITHMIC_SHARE) / half

    def closer(_: Any, theta: Array) -> Array:
        # The rank is concave in theta, so Newton's steps converge from below without overshoot.
        value = _LOGARITHMIC_SHARE * jnp.log1p(theta / width) / span + (1 - _LOGARITHMIC_SHARE) * theta / half
        return theta + (rank - value) / rise(theta)

    theta = jax.lax.fori_loop(0, _NEWTON_STEPS, closer, jnp.zeros_like(rank))
    return theta, by_place / rise(theta)


def layer_width(oscillator: Oscillator, frame: Frame, amplitude: Array) -> Array:
    """Return the phase interval in which friction changes fast [rad].

    It ends when the velocity exceeds the velocity scale of the law.
    """
    speed = oscillator.friction.velocity_scale()
    return speed / (frame.angular_frequency * jnp.maximum(amplitude, jnp.finfo(float).tiny))


def separatrix_width(oscillator: Oscillator, amplitude: Array) -> Array:
    """Return the phase interval near an unstable equilibrium [rad].

    It is inf for a linear spring. The rate of time has poles at zeros of the slope of the stretched coordinate. With
    the slope ``sqrt(1 - Q^2 cos^2(theta)/4)`` of a pendulum they lie at a distance of ``arccosh(2/Q)`` from the
    reversals, which is the inverse hyperbolic tangent of the slope there. A slope above one belongs to a stiffening
    spring, which has no such poles.
    """
    slope = jnp.asarray(oscillator.restoring.unstretched(amplitude)[1])
    # Beyond the separatrix there is no half-cycle; any valid mesh will do.
    return jnp.arctanh(jnp.where(slope > _STEEPEST, jnp.minimum(slope, 1.0), _STEEPEST))


def integrate_phase(
    oscillator: Oscillator, frame: Frame, amplitude: Float[Array, ""], theta: Float[Array, " nodes"]
) -> tuple[Float[Array, " nodes"], Float[Array, " nodes"]]:
    """Integrate amplitude and elapsed time over the phases `theta`."""
    import diffrax

    tableau = diffrax.Dopri8.tableau
    # The last stage of the published table is the first one of the next step.
    stages = tableau.num_stages - 1
    fractions, couplings_of = np.append(0.0, tableau.c[: stages - 1]), (np.zeros(0), *tableau.a_lower[: stages - 1])
    weights, steps = tableau.b_sol[:stages], jnp.diff(theta)
    angles = Angle.of(theta[:-1, None] + steps[:, None] * fractions)

    # A separate jitted function is traced once for all stages.
    @jax.jit
    def rates(amplitude: Array, angle: Angle) -> _Pair:
        return once(phase_rates(oscillator, frame, amplitude, angle))

    def step(now: _Pair, at: tuple[Array, Angle]) -> tuple[_Pair, _Pair]:
        width, angle = at
        rises, lapses = [], []
        for i, couplings in enumerate(couplings_of):
            there = once(now[0] + width * _combined(couplings, rises))
            rise, lapse = rates(there, angle.at(i))
            rises.append(rise)
            lapses.append(lapse)
        then = once((now[0] + width * _combined(weights, rises), now[1] + width * _combined(weights, lapses)))
        return then, then

    begin = (amplitude, jnp.zeros_like(amplitude))
    _, rest = jax.lax.scan(step, begin, (steps, angles))
    amplitudes, elapsed = (jnp.concatenate([y[None], ys]) for y, ys in zip(begin, rest, strict=True))
    return amplitudes, elapsed


def _combined(weights: np.ndarray, values: list[Array]) -> Array:
    """Return the weighted sum without vanishing terms."""
    terms = (float(weight) * value for weight, value in zip(weights, values, strict=False) if weight)
    return sum(terms, start=jnp.zeros(()))
