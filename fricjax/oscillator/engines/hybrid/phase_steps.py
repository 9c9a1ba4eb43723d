"""Integration over the phase of a half-cycle, by explicit steps of order eight (Prince and Dormand 1981).

The phases of all stages are known beforehand, so their sines and cosines are computed side by side. The lapse of time
follows from the amplitude and drives nothing, so only its quadrature is made.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...oscillator import Oscillator
from ..elementary import once
from .frame import Angle, Frame, phase_rates

_TABLEAU = diffrax.Dopri8.tableau
# The last stage of the published table is the first one of the next step.
_STAGES = _TABLEAU.num_stages - 1
_FRACTIONS = np.append(0.0, _TABLEAU.c[: _STAGES - 1])
_COUPLINGS = (np.zeros(0), *_TABLEAU.a_lower[: _STAGES - 1])
_WEIGHTS = _TABLEAU.b_sol[:_STAGES]

_Pair = tuple[Array, Array]


def integrate_phase(
    oscillator: Oscillator, frame: Frame, amplitude: Float[Array, ""], theta: Float[Array, " nodes"]
) -> tuple[Float[Array, " nodes"], Float[Array, " nodes"]]:
    """Amplitude and elapsed time at the phases `theta` of a half-cycle."""
    steps = jnp.diff(theta)
    angles = Angle.of(theta[:-1, None] + steps[:, None] * _FRACTIONS)

    def step(now: _Pair, at: tuple[Array, Angle]) -> tuple[_Pair, _Pair]:
        width, angle = at
        rises, lapses = [], []
        for i, couplings in enumerate(_COUPLINGS):
            there = once(now[0] + width * _combined(couplings, rises))
            rise, lapse = once(phase_rates(oscillator, frame, there, angle.at(i)))
            rises.append(rise)
            lapses.append(lapse)
        then = once((now[0] + width * _combined(_WEIGHTS, rises), now[1] + width * _combined(_WEIGHTS, lapses)))
        return then, then

    begin = (amplitude, jnp.zeros_like(amplitude))
    _, rest = jax.lax.scan(step, begin, (steps, angles))
    amplitudes, elapsed = (jnp.concatenate([y[None], ys]) for y, ys in zip(begin, rest, strict=True))
    return amplitudes, elapsed


def _combined(weights: np.ndarray, values: list[Array]) -> Array:
    """Weighted sum, without the terms that vanish."""
    terms = (float(weight) * value for weight, value in zip(weights, values, strict=False) if weight)
    return sum(terms, start=jnp.zeros(()))
