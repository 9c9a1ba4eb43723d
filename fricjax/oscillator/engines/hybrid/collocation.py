"""Collocation of many half-cycles in parallel at Chebyshev points.

The amplitude equation ``dA/dtheta = g(theta, A)`` is linearised about the last approximation and solved at all points
together: with ``E = exp(int g_A)`` follows ``A = E (A_0 + int (g - g_A A)/E)``. This quasilinearisation (Bellman and
Kalaba 1965) is exact for terms linear in the amplitude, such as viscous damping, and doubles the correct digits at each
iteration. A change of the parameters changes the solution by ``E (dA_0 + int dg/E)``, the same equation again, so
derivatives cost two quadratures.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import chebyshev

from ...oscillator import Oscillator
from .frame import Angle, Frame, phase_rates
from .phase_steps import mesh_fractions, phase_of

# Iterations from a constant approximation; each squares the relative error, initially some per cent.
_STEPS = 5

Machine = tuple[Oscillator, Frame]


class Panels(NamedTuple):
    """Collocation points in both halves of a half-cycle, and output nodes.

    Attributes:
        angle, slope: phase of the points, and its slope with respect to their rank in the half, shape (2, points, ...).
        fractions: the nodes as fractions of the half-cycle, shape (nodes,), equidistant in the rank.
    """

    angle: Angle
    slope: Array
    fractions: Array

    def over(self, axes: int) -> "Panels":
        """Return the panels broadcast over that many further axes."""
        wide = (..., *(None,) * axes)
        return Panels(self.angle.at(wide), self.slope[wide], self.fractions)


def make_panels(steps: int, layer: Array, skew: Any = 0.0) -> Panels:
    """Create panels for a mesh of `steps` steps.

    The points are denser at the reversals, like the nodes. Their number makes the collocation error much smaller than
    the interpolation error between nodes.
    """
    theta, slope = phase_of(jnp.asarray((1 + _points(steps * 4 // 3)) / 2), layer, skew)
    angle = Angle.of(jnp.stack([theta, jnp.pi - theta[::-1]]))
    return Panels(angle, jnp.stack([slope, slope[::-1]]), mesh_fractions(steps, layer, skew))


def collocate(
    oscillator: Oscillator, frame: Frame, amplitude: Float[Array, "*batch"], panels: Panels
) -> tuple[Float[Array, "nodes *batch"], Float[Array, "nodes *batch"]]:
    """Return amplitude and elapsed time at the nodes of half-cycles from rest.

    One batch member per initial amplitude.
    """
    wide, machine = panels.over(amplitude.ndim), (oscillator, frame)
    amplitudes = _amplitudes(amplitude, machine, wide)
    elapsed = _integral(_rates(machine, wide, amplitudes)[1], wide)
    return _read(amplitudes, wide), _read(elapsed, wide)


@jax.custom_jvp
def _amplitudes(start: Array, machine: Machine, panels: Panels) -> Array:
    """Return the amplitudes at the collocation points, shape (2, points, *start.shape)."""

    def closer(_: Any, amplitudes: Array) -> Array:
        rate, slope = _linearised(machine, panels, amplitudes)
        growth = jnp.exp(_integral(slope, panels))
        return growth * (start + _integral((rate - slope * amplitudes) / growth, panels))

    return jax.lax.fori_loop(0, _STEPS, closer, jnp.broadcast_to(start, panels.slope.shape[:2] + start.shape))


@_amplitudes.defjvp
def _amplitudes_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    (start, machine, panels), (start_change, change, _) = primals, tangents
    amplitudes = _amplitudes(start, machine, panels)
    growth = jnp.exp(_integral(_linearised(machine, panels, amplitudes)[1], panels))
    push = jax.jvp(lambda at: _rates(at, panels, amplitudes)[0], (machine,), (change,))[1]
    return amplitudes, growth * (start_change + _integral(push / growth, panels))


# A separate jitted function is traced once for all callers.
@jax.jit
def _rates(machine: Machine, panels: Panels, amplitudes: Array) -> tuple[Array, Array]:
    return phase_rates(*machine, amplitudes, panels.angle)


def _linearised(machine: Machine, panels: Panels, amplitudes: Array) -> tuple[Array, Array]:
    """Return dA/dtheta and its derivative with respect to the amplitude."""
    return jax.jvp(lambda at: _rates(machine, panels, at)[0], (amplitudes,), (jnp.ones_like(amplitudes),))


def _integral(rates: Array, panels: Panels) -> Array:
    """Integrate over the phase from its start to each point."""
    parts = jnp.einsum("ij,pj...->pi...", jnp.asarray(_integration(rates.shape[1])), panels.slope * rates)
    return jnp.stack([parts[0], parts[1] + parts[0, -1]])


def _read(values: Array, panels: Panels) -> Array:
    """Interpolate values from the points to the nodes."""
    count, ranks = values.shape[1], np.linspace(-1, 1, (panels.fractions.size + 1) // 2)
    reading = jnp.asarray(chebyshev.chebvander(ranks, count - 1) @ _coefficients(count))
    halves = jnp.einsum("ij,pj...->pi...", reading, values)
    return jnp.concatenate([halves[0], halves[1, 1:]])


def _points(count: int) -> np.ndarray:
    """Return Chebyshev points of the second kind in ascending order."""
    return -np.cos(np.pi * np.arange(count) / (count - 1))


def _integration(count: int) -> np.ndarray:
    """Return the matrix that integrates from the first point.

    The ranks run from 0 to 1.
    """
    unit = np.identity(count)
    columns = [chebyshev.chebval(_points(count), chebyshev.chebint(row, lbnd=-1)) for row in unit]
    return np.stack(columns, axis=1) @ _coefficients(count) / 2


def _coefficients(count: int) -> np.ndarray:
    """Return the matrix from values at the points to Chebyshev coefficients."""
    return np.linalg.inv(chebyshev.chebvander(_points(count), count - 1))
