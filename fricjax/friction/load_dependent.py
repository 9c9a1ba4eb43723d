"""Coulomb friction with a load-dependent coefficient and with adhesion."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx

from .base import Scalar, scalar
from .coefficient import MU, Coefficient, not_negative, positive
from .kinds import AbstractConstant


class LoadDependent(AbstractConstant):
    """Coulomb friction that depends on the load, with adhesion.

    ``F = [mu N (N/reference_load)^(exponent - 1) + adhesion] sgn(v)``.

    The exponent is 1 if the true area of contact is proportional to the load (many asperities, Archard), and 2/3 for a
    single elastic contact (Hertz), such as a ball on a polymer.

    Attributes:
        mu: coefficient of friction at the reference load [1], without adhesion.
        exponent: power with which the friction force grows with the load [1].
        reference_load: load at which `mu` holds [N].
        adhesion: friction force without load [N].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.LoadDependent(mu=0.2, exponent=2 / 3, reference_load=10.0)
        >>> [round(float(law.dynamic_force(np.float64(load))), 3) for load in (5.0, 10.0, 20.0)]  # N
        [1.26, 2.0, 3.175]
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "exponent": positive("", "power of the load: 1 many asperities, 2/3 one elastic contact"),
        "reference_load": positive("N", "load at which mu holds"),
        "adhesion": not_negative("N", "friction force without load"),
    }
    source: ClassVar[str] = "J. F. Archard, Proc. R. Soc. A 243 (1957); F. P. Bowden and D. Tabor (1950)"
    identifies: ClassVar[str] = (
        "mu as in Coulomb's law; exponent and adhesion only from runs under several loads, because one load gives only "
        "one force."
    )

    mu: Scalar = eqx.field(converter=scalar)
    exponent: Scalar = eqx.field(converter=scalar, default=1.0)
    reference_load: Scalar = eqx.field(converter=scalar, default=1.0)
    adhesion: Scalar = eqx.field(converter=scalar, default=0.0)

    def static_force(self, load: Scalar) -> Scalar:
        return self.dynamic_force(load)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * self.reference_load * (load / self.reference_load) ** self.exponent + self.adhesion
