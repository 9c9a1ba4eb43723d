"""Stribeck friction (Bo and Pavelescu, 1982).

The force falls from its static to its dynamic value as sliding begins.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, Values, scalar
from .coefficient import MU, MU_S, V_STRIBECK, Coefficient, positive
from .stribeck_curve import AbstractFalling


class Stribeck(AbstractFalling):
    """Stribeck friction, which falls exponentially with the speed.

    ``F = N [mu + (mu_s - mu) exp(-|v/v_stribeck|^exponent)] sgn(v)``. At rest the friction force is at most ``mu_s N``.

    Attributes:
        mu: dynamic coefficient of friction [1], reached at speeds well above `v_stribeck`.
        mu_s: static coefficient of friction [1]; None ties it to `mu`, which gives Coulomb's law.
        v_stribeck: Stribeck velocity [m/s].
        exponent: shape of the fall [1]: 2 Gaussian, 1 exponential (Tustin).

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Stribeck(mu=0.2, mu_s=0.25, v_stribeck=5e-3)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4998, 2.0092], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "mu_s": MU_S,
        "v_stribeck": V_STRIBECK,
        "exponent": positive("", "shape of the fall: 2 Gaussian, 1 exponential"),
    }
    source: ClassVar[str] = "L. C. Bo and D. Pavelescu, Wear 82 (1982); B. Armstrong-Helouvry (1991)"
    identifies: ClassVar[str] = (
        "mu to parts in 10^8; only the product (mu_s - mu) v_stribeck^2 if v_stribeck is far below the speeds of the "
        "run, otherwise mu_s and v_stribeck separately; exponent hardly ever."
    )

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    v_stribeck: Scalar = eqx.field(converter=scalar, default=1e-3)
    exponent: Scalar = eqx.field(converter=scalar, default=2.0)

    def remaining(self, speed: Values) -> Values:
        ratio = speed / self.v_stribeck
        # At both ends the power rule multiplies zero by infinity; insert the known limits.
        regular = (ratio > 0) & (ratio < 1e20)
        power = jnp.exp(self.exponent * jnp.log(jnp.where(regular, ratio, 1.0)))
        return jnp.where(regular, jnp.exp(-power), jnp.where(ratio > 0, 0.0, 1.0))
