"""Physical values of a solved fit: parameters, machine, and kinematics.

Kinematics are quantities that need no rig: they do not depend on the common scale of mass, stiffness and load.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimation.covariance import Covariance
from ..friction import QuadraticDrag
from ..friction.base import laws_of
from ..oscillator import Oscillator
from ..rig import Measured
from ..tables.interpreter import evaluate
from .residual import Residual


class Derived(NamedTuple):
    """Physical values for the coordinates of a fit.

    Attributes:
        values: values of the parameters in their own units, shape (p,); `slope`: derivative of each with respect to its
            coordinate.
        machine: the oscillator.
        kinematics: the quantities of `UNITS` in order, shape (q,); `by_coordinate`: their derivatives with respect to
            the coordinates and the inputs of the rig, shape (q, coordinates).
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
    """Return the physical values for coordinates `y`; traceable."""
    p = residual.n_parameters
    slope = residual.space.slope(y[:p])

    def quantities(at: Array) -> tuple[Array, tuple[Oscillator, Array]]:
        machine = residual.machine(at)
        values = _quantities(machine)
        return values, (machine, values)

    by_coordinate, (machine, values) = jax.jacfwd(quantities, has_aux=True)(y)
    return Derived(residual.values(y), slope, machine, values, by_coordinate)


def derive_on_host(residual: Residual, y: np.ndarray) -> Derived:
    """Return the physical values for coordinates `y`, without compilation."""
    # Neither the engine nor the records matter.
    few = residual._replace(engine=None, runs=())  # pyright: ignore[reportArgumentType]
    leaves, structure = jax.tree.flatten(few)
    program, out = _traced(structure, tuple(np.shape(leaf) for leaf in leaves), np.shape(y))
    results = evaluate(program, *(np.asarray(leaf, dtype=float) for leaf in leaves), y)
    return jax.tree.unflatten(jax.tree.structure(out), results)


@functools.lru_cache(maxsize=64)
def _traced(structure: Any, shapes: tuple[tuple[int, ...], ...], coordinates: tuple[int, ...]) -> Any:
    number = lambda shape: jax.ShapeDtypeStruct(shape, np.float64)

    def flat(*arguments: Any) -> Any:
        return derive(jax.tree.unflatten(structure, arguments[:-1]), arguments[-1])

    return jax.make_jaxpr(flat, return_shape=True)(*map(number, shapes), number(coordinates))


def _quantities(oscillator: Oscillator) -> Float[Array, " quantities"]:
    friction = oscillator.friction.dynamic_force(oscillator.normal_force)
    in_law = sum(law.quadratic_drag for law in laws_of(oscillator.friction) if isinstance(law, QuadraticDrag))
    return jnp.stack(
        [
            oscillator.angular_frequency / (2 * jnp.pi),
            oscillator.damping_ratio,
            oscillator.dead_band,
            friction / oscillator.mass,
            (oscillator.drag + in_law) / oscillator.mass,
        ]
    )


def kinematics(derived: Derived, covariances: Covariance) -> dict[str, Measured]:
    """Return the kinematic quantities with their statistical standard errors.

    They are the undamped natural frequency, the damping ratio, the dead band mu N/k, and friction and drag per unit
    mass.

    Args:
        derived: physical values of the solved fit.
        covariances: covariances of its parameters; only the statistical one is used.
    """
    estimates = {}
    for (name, unit), value, slope in zip(UNITS.items(), derived.kinematics, derived.by_value, strict=True):
        used = slope != 0
        variance = slope[used] @ covariances.statistical[np.ix_(used, used)] @ slope[used]
        estimates[name] = Measured(float(value), float(np.sqrt(variance)), unit)
    return estimates


def contributions(names: Sequence[str], derived: Derived, covariances: Covariance) -> dict[str, np.ndarray]:
    """Return the effect of each rig input on parameters and kinematics.

    An effect is the change per standard uncertainty of the input. Kinematics change directly, if the input is a
    coefficient of the machine, and through the parameters.

    Args:
        names: names of the parameters.
        derived: physical values of the solved fit.
        covariances: covariances of its parameters.
    """
    direct = np.asarray(derived.by_coordinate)[:, len(names) :]
    followed = derived.by_value @ covariances.contributions
    return dict(zip([*names, *UNITS], [*covariances.contributions, *(direct + followed)], strict=True))
