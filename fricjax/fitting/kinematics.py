"""What a trace tells without any rig: quantities in which the common scale of mass, stiffness and load drops out."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..oscillator import Oscillator
from .residual import Residual


class Estimate(NamedTuple):
    """A value with its standard uncertainty and its unit."""

    value: float
    std: float
    unit: str


UNITS = {
    "natural_frequency": "Hz",
    "damping_ratio": "",
    "dead_band": "m",
    "friction_deceleration": "m/s^2",
    "drag_rate": "1/m",
}


def _quantities(oscillator: Oscillator) -> Float[Array, " quantities"]:
    friction = oscillator.friction.dynamic_force(oscillator.normal_force)
    return jnp.stack(
        [
            oscillator.angular_frequency / (2 * jnp.pi),
            oscillator.damping_ratio,
            oscillator.dead_band,
            friction / oscillator.mass,
            oscillator.drag / oscillator.mass,
        ]
    )


@eqx.filter_jit
def _with_slopes(residual: Residual, y: Float[Array, " coordinates"]) -> tuple[Array, Array]:
    """The quantities and their derivatives with respect to the values of the parameters."""

    def of(at: Array) -> Array:
        return _quantities(residual.machine(at))

    p = residual.n_parameters
    return of(y), jax.jacfwd(of)(y)[:, :p] / residual.space.slope(y[:p])


def kinematics(residual: Residual, y: Float[Array, " coordinates"], covariance: np.ndarray) -> dict[str, Estimate]:
    """Undamped natural frequency, damping ratio, dead band mu N/k, and friction and drag per unit mass.

    Args:
        residual: the fitted problem.
        y: coordinates of the optimum.
        covariance: statistical covariance, shape (p, p), inf where undetermined.
    """
    found, slopes = (np.asarray(a) for a in _with_slopes(residual, y))
    estimates = {}
    for (name, unit), value, slope in zip(UNITS.items(), found, slopes, strict=True):
        used = slope != 0
        variance = slope[used] @ covariance[np.ix_(used, used)] @ slope[used]
        estimates[name] = Estimate(float(value), float(np.sqrt(variance)), unit)
    return estimates
