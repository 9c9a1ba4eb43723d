"""Drag of the surrounding air, quadratic in the velocity."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .coefficient import Coefficient
from .kinds import AbstractResistance


class QuadraticDrag(AbstractResistance):
    """Quadratic drag, ``F = quadratic_drag v|v|``.

    Add it to a contact law: ``Coulomb(0.01) + QuadraticDrag(7e-3)``.

    The `drag` of the oscillator is the same force; use only one of the two.

    Attributes:
        quadratic_drag: coefficient [N s^2/m^2].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(0.01) + fj.friction.QuadraticDrag(7e-3)
        >>> speed, load = np.array([0.1, 1.0]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 5)  # N, of steady sliding
        Array([0.10007, 0.107  ], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"quadratic_drag": Coefficient("N s^2/m^2", "force at 1 m/s")}
    source: ClassVar[str] = "Newton's law of resistance, c = rho C_d A/2"
    identifies: ClassVar[str] = (
        "quadratic_drag together with mu and damping, because its force grows with the square of the amplitude."
    )

    quadratic_drag: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.quadratic_drag * v * jnp.abs(v)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.quadratic_drag * speed**2
