"""Rolling friction of a ball, with the hysteresis before it rolls freely (Drutowski 1959, Greenwood and Tabor 1958)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, scalar
from .coefficient import MU, Coefficient, positive
from .kinds import AbstractDeflection


class Rolling(AbstractDeflection):
    """``dz/dt = v - |v| z/length``, ``F = mu(N) N z/length`` with ``mu(N) = mu (N/reference_load)^load_exponent``.

    A ball needs to travel about the radius of its contact before the friction force has changed its sign, far more
    than a sliding contact does. In the deflection of the contact this is Dahl's law with a length that does not
    depend on the load. With a loss by elastic hysteresis in a Hertzian contact mu grows as N^(1/3).

    Attributes:
        mu: coefficient of rolling friction at the reference load [1].
        length: travel over which the force settles [m]; about the radius of the contact, 0.05 to 0.2 mm.
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
        "length": positive("m", "travel over which the force settles"),
        "load_exponent": Coefficient("", "growth of the coefficient with the load"),
        "reference_load": positive("N", "load to which mu refers"),
    }
    source: ClassVar[str] = "J. A. Greenwood and D. Tabor (1958); S. K. Drutowski, J. Basic Eng. 81 (1959)"
    identifies: ClassVar[str] = (
        "mu and length from one decay of half-cycles longer than length; load_exponent from runs at several loads; "
        "reference_load never, it only says to which load mu refers."
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
