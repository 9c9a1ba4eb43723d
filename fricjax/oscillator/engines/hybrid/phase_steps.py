"""The mesh of a half-cycle in phase, and integration on it by explicit steps of order eight (Prince and Dormand 1981).

The phases of all stages are known beforehand, so their sines and cosines are computed side by side. The lapse of time
follows from the amplitude and drives nothing, so only its quadrature is made.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...oscillator import Oscillator
from ..elementary import once
from .frame import Angle, Frame, phase_rates

# Part of the points that is spread evenly over the logarithm of the distance from the layer; the rest is even in phase,
# so that steps in the middle stay short however thin the layer is. Chosen, not derived.
_LOGARITHMIC_SHARE = 0.6
# Newton steps from the reversal on: thirteen reach rounding for the thinnest layer, 1e-9 rad.
_NEWTON_STEPS = 24
# Slope of the stretched coordinate at which a turning point counts as the unstable equilibrium itself.
_STEEPEST = 1e-6

_Pair = tuple[Array, Array]


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


def integrate_phase(
    oscillator: Oscillator, frame: Frame, amplitude: Float[Array, ""], theta: Float[Array, " nodes"]
) -> tuple[Float[Array, " nodes"], Float[Array, " nodes"]]:
    """Amplitude and elapsed time at the phases `theta` of a half-cycle."""
    import diffrax

    tableau = diffrax.Dopri8.tableau
    # The last stage of the published table is the first one of the next step.
    stages = tableau.num_stages - 1
    fractions, couplings_of = np.append(0.0, tableau.c[: stages - 1]), (np.zeros(0), *tableau.a_lower[: stages - 1])
    weights, steps = tableau.b_sol[:stages], jnp.diff(theta)
    angles = Angle.of(theta[:-1, None] + steps[:, None] * fractions)

    def step(now: _Pair, at: tuple[Array, Angle]) -> tuple[_Pair, _Pair]:
        width, angle = at
        rises, lapses = [], []
        for i, couplings in enumerate(couplings_of):
            there = once(now[0] + width * _combined(couplings, rises))
            rise, lapse = once(phase_rates(oscillator, frame, there, angle.at(i)))
            rises.append(rise)
            lapses.append(lapse)
        then = once((now[0] + width * _combined(weights, rises), now[1] + width * _combined(weights, lapses)))
        return then, then

    begin = (amplitude, jnp.zeros_like(amplitude))
    _, rest = jax.lax.scan(step, begin, (steps, angles))
    amplitudes, elapsed = (jnp.concatenate([y[None], ys]) for y, ys in zip(begin, rest, strict=True))
    return amplitudes, elapsed


def _combined(weights: np.ndarray, values: list[Array]) -> Array:
    """Weighted sum, without the terms that vanish."""
    terms = (float(weight) * value for weight, value in zip(weights, values, strict=False) if weight)
    return sum(terms, start=jnp.zeros(()))
