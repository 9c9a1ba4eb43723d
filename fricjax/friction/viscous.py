"""Viscous friction of the contact: a lubricating film resists in proportion to the velocity."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx

from .base import Scalar, State, Values, scalar
from .coefficient import SIGMA2, Coefficient
from .kinds import AbstractResistance


class Viscous(AbstractResistance):
    """``F = sigma2 v``, to be added to a contact law: ``Coulomb(0.01) + Viscous(2.0)``.

    The oscillator's own `damping` is the same force. Where the machine is calibrated without contact, its damping stays
    fixed and this is what the contact adds to it; a fit frees one of the two.

    Attributes:
        sigma2: viscous coefficient of the contact [N s/m]; may be negative, the fingerprint of a falling friction law.

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
        "sigma2 apart from mu by its growth with the amplitude, from about five half-cycles on; never apart from "
        "damping, so fix one."
    )

    sigma2: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.sigma2 * v

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.sigma2 * speed
