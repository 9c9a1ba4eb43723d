"""Viscous friction of a lubricated contact, proportional to the velocity."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx

from .base import Scalar, State, Values, scalar
from .coefficient import SIGMA2, Coefficient
from .kinds import AbstractResistance


class Viscous(AbstractResistance):
    """Viscous friction of the contact, ``F = sigma2 v``.

    Add it to a contact law: ``Coulomb(0.01) + Viscous(2.0)``.

    The `damping` of the oscillator is the same force, so a fit can free only one of the two. If the machine is
    calibrated without contact, keep its damping fixed and free `sigma2`, the contribution of the contact.

    Attributes:
        sigma2: viscous coefficient of the contact [N s/m]; a negative value indicates a falling friction law.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(0.2) + fj.friction.Viscous(sigma2=3.0)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.0003, 2.03  ], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"sigma2": SIGMA2}
    source: ClassVar[str] = "O. Reynolds, Phil. Trans. R. Soc. 177 (1886)"
    identifies: ClassVar[str] = (
        "sigma2 together with mu from about five half-cycles, because its loss grows with the amplitude; never "
        "together with damping, so fix one of the two."
    )

    sigma2: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.sigma2 * v

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.sigma2 * speed
