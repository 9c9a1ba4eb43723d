"""Many half-cycles side by side: their amplitude and time over the phase, by collocation at Chebyshev points.

The equation of the amplitude, ``dA/dtheta = g(theta, A)``, is linearised about the last approximation and solved at
all points at once: with ``E = exp(int g_A)`` follows ``A = E (A_0 + int (g - g_A A)/E)``. This quasilinearisation
(Bellman and Kalaba 1965) is exact for what is linear in the amplitude, such as viscous damping, and doubles the
correct digits each time. A change of the parameters changes the solution by ``E (dA_0 + int dg/E)``, the same equation
once more, so that derivatives cost two quadratures.
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

# The first approximation is constant; each step squares what the last one left of some per cent.
_STEPS = 5

Machine = tuple[Oscillator, Frame]


class Panels(NamedTuple):
    """Points of collocation in either half of a half-cycle, and the nodes at which the motion is wanted.

    Attributes:
        angle, slope: phase of the points and its slope over their rank in the half, shape (2, points, ...).
        fractions: the nodes as fractions of the half-cycle, shape (nodes,), equidistant in the rank.
    """

    angle: Angle
    slope: Array
    fractions: Array

    def over(self, axes: int) -> "Panels":
        """The same for states that have so many axes more."""
        wide = (..., *(None,) * axes)
        return Panels(self.angle.at(wide), self.slope[wide], self.fractions)


def make_panels(steps: int, layer: Array, skew: Any = 0.0) -> Panels:
    """Panels for a mesh of `steps` steps; the points are denser at the reversals as its nodes are.

    There are so many that the motion is off by far less than interpolation between the nodes is.
    """
    theta, slope = phase_of(jnp.asarray((1 + _points(steps * 4 // 3)) / 2), layer, skew)
    angle = Angle.of(jnp.stack([theta, jnp.pi - theta[::-1]]))
    return Panels(angle, jnp.stack([slope, slope[::-1]]), mesh_fractions(steps, layer, skew))


def collocate(
    oscillator: Oscillator, frame: Frame, amplitude: Float[Array, "*batch"], panels: Panels
) -> tuple[Float[Array, "nodes *batch"], Float[Array, "nodes *batch"]]:
    """Amplitude and elapsed time of half-cycles from rest at the nodes; one batch member per amplitude."""
    wide, machine = panels.over(amplitude.ndim), (oscillator, frame)
    amplitudes = _amplitudes(amplitude, machine, wide)
    elapsed = _integral(_rates(machine, wide, amplitudes)[1], wide)
    return _read(amplitudes, wide), _read(elapsed, wide)


@jax.custom_jvp
def _amplitudes(start: Array, machine: Machine, panels: Panels) -> Array:
    """Amplitudes at the points of collocation, shape (2, points, *start.shape)."""

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


# As a function of its own it is traced once for all that ask for it.
@jax.jit
def _rates(machine: Machine, panels: Panels, amplitudes: Array) -> tuple[Array, Array]:
    return phase_rates(*machine, amplitudes, panels.angle)


def _linearised(machine: Machine, panels: Panels, amplitudes: Array) -> tuple[Array, Array]:
    """dA/dtheta, and its derivative by the amplitude."""
    return jax.jvp(lambda at: _rates(machine, panels, at)[0], (amplitudes,), (jnp.ones_like(amplitudes),))


def _integral(rates: Array, panels: Panels) -> Array:
    """Integral over the phase from its start to each point."""
    parts = jnp.einsum("ij,pj...->pi...", jnp.asarray(_integration(rates.shape[1])), panels.slope * rates)
    return jnp.stack([parts[0], parts[1] + parts[0, -1]])


def _read(values: Array, panels: Panels) -> Array:
    """Values at the nodes, from those at the points."""
    count, ranks = values.shape[1], np.linspace(-1, 1, (panels.fractions.size + 1) // 2)
    reading = jnp.asarray(chebyshev.chebvander(ranks, count - 1) @ _coefficients(count))
    halves = jnp.einsum("ij,pj...->pi...", reading, values)
    return jnp.concatenate([halves[0], halves[1, 1:]])


def _points(count: int) -> np.ndarray:
    """Chebyshev points of the second kind, in rising order."""
    return -np.cos(np.pi * np.arange(count) / (count - 1))


def _integration(count: int) -> np.ndarray:
    """Matrix from values at the points to integrals from the first point on, over ranks from 0 to 1."""
    unit = np.identity(count)
    columns = [chebyshev.chebval(_points(count), chebyshev.chebint(row, lbnd=-1)) for row in unit]
    return np.stack(columns, axis=1) @ _coefficients(count) / 2


def _coefficients(count: int) -> np.ndarray:
    """Matrix from values at the points to Chebyshev coefficients."""
    return np.linalg.inv(chebyshev.chebvander(_points(count), count - 1))
