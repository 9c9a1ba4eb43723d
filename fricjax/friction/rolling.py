"""Rolling friction of a ball, with the hysteresis before free rolling.

Sources: Drutowski (1959), Greenwood and Tabor (1958).
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, scalar
from .coefficient import MU, Coefficient, positive
from .kinds import AbstractDeflection


class Rolling(AbstractDeflection):
    """Rolling friction with hysteresis at each reversal.

    ``dz/dt = v - |v| z/length``, ``F = mu(N) N z/length`` with ``mu(N) = mu (N/reference_load)^load_exponent``.

    After a reversal a ball travels about the radius of its contact before the friction force changes sign. This is far
    more than a sliding contact needs. The law is Dahl's law for the deflection of the contact, with a length that does
    not depend on the load. If elastic hysteresis in a Hertzian contact causes the loss, mu grows as N^(1/3).

    Attributes:
        mu: coefficient of rolling friction at the reference load [1].
        length: distance over which the force reaches its steady value [m]; about the contact radius, 0.05 to 0.2 mm.
        load_exponent: growth of the coefficient with the load [1]: 0 none, 1/3 elastic hysteresis.
        reference_load: load to which `mu` refers [N]; keep it fixed in fits.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Rolling(mu=2e-3, length=2e-5)
        >>> float(law.dynamic_force(np.float64(10.0)))  # N
        0.02
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU._replace(about="coefficient of rolling friction at the reference load"),
        "length": positive("m", "distance over which the force reaches its steady value"),
        "load_exponent": Coefficient("", "growth of the coefficient with the load"),
        "reference_load": positive("N", "load to which mu refers"),
    }
    source: ClassVar[str] = "J. A. Greenwood and D. Tabor (1958); S. K. Drutowski, J. Basic Eng. 81 (1959)"
    identifies: ClassVar[str] = (
        "mu and length from one decay with half-cycles longer than length; load_exponent from runs at several loads; "
        "reference_load never, because it only states the load to which mu refers."
    )

    mu: Scalar = eqx.field(converter=scalar)
    length: Scalar = eqx.field(converter=scalar)
    load_exponent: Scalar = eqx.field(converter=scalar, default=0.0)
    reference_load: Scalar = eqx.field(converter=scalar, default=1.0)

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return v - jnp.abs(v) * state / self.length

    def settling_length(self, load: Scalar) -> Scalar:
        return self.length

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load * (load / self.reference_load) ** self.load_exponent
