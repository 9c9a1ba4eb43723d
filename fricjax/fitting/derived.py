"""A solved fit in the terms of its user: values of the parameters, the machine, and what a trace tells without any rig.

The latter are quantities in which the common scale of mass, stiffness and load drops out.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimation.covariance import Covariance
from ..oscillator import Oscillator
from ..rig import Measured
from .residual import Residual


class Derived(NamedTuple):
    """What the coordinates of a fit stand for.

    Attributes:
        values: values of the parameters in their own units, shape (p,); `slope`: derivative of each with respect to
            its coordinate.
        machine: the oscillator.
        kinematics: the quantities of `UNITS` in order, shape (q,); `by_coordinate`: their derivatives with respect to
            the coordinates, those of the inputs of the rig included, shape (q, coordinates).
    """

    values: Any
    slope: Any
    machine: Oscillator
    kinematics: Any
    by_coordinate: Any

    @property
    def by_value(self) -> np.ndarray:
        """Derivatives of the kinematics with respect to the values, shape (q, p)."""
        return np.asarray(self.by_coordinate)[:, : len(self.slope)] / np.asarray(self.slope)


UNITS = {
    "natural_frequency": "Hz",
    "damping_ratio": "",
    "dead_band": "m",
    "friction_deceleration": "m/s^2",
    "drag_rate": "1/m",
}


def derive(residual: Residual, y: Float[Array, " coordinates"]) -> Derived:
    """What coordinates `y` stand for; traced."""
    p = residual.n_parameters
    slope = residual.space.slope(y[:p])

    def quantities(at: Array) -> tuple[Array, tuple[Oscillator, Array]]:
        machine = residual.machine(at)
        values = _quantities(machine)
        return values, (machine, values)

    by_coordinate, (machine, values) = jax.jacfwd(quantities, has_aux=True)(y)
    return Derived(residual.values(y), slope, machine, values, by_coordinate)


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


def kinematics(derived: Derived, covariances: Covariance) -> dict[str, Measured]:
    """Undamped natural frequency, damping ratio, dead band mu N/k, and friction and drag per unit mass.

    Args:
        derived: the solved fit.
        covariances: covariances of its parameters, of which the statistical one counts.
    """
    estimates = {}
    for (name, unit), value, slope in zip(UNITS.items(), derived.kinematics, derived.by_value, strict=True):
        used = slope != 0
        variance = slope[used] @ covariances.statistical[np.ix_(used, used)] @ slope[used]
        estimates[name] = Measured(float(value), float(np.sqrt(variance)), unit)
    return estimates


def contributions(names: Sequence[str], derived: Derived, covariances: Covariance) -> dict[str, np.ndarray]:
    """Change of each parameter and of each of the kinematics for one standard uncertainty of each input of the rig.

    An input changes the kinematics where it is a coefficient of the machine, and as the parameters follow it.

    Args:
        names: of the parameters.
        derived: the solved fit.
        covariances: covariances of its parameters.
    """
    direct = np.asarray(derived.by_coordinate)[:, len(names) :]
    followed = derived.by_value @ covariances.contributions
    return dict(zip([*names, *UNITS], [*covariances.contributions, *(direct + followed)], strict=True))
