"""Stribeck friction with a Lorentzian fall (Hess and Soom, 1990)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from .base import Scalar, Values, scalar
from .coefficient import MU, MU_S, V_STRIBECK, Coefficient, positive
from .stribeck_curve import AbstractFalling


class Lorentzian(AbstractFalling):
    """Stribeck friction, which falls as a Lorentzian of the speed.

    ``F = N [mu + (mu_s - mu)/(1 + |v/v_stribeck|^exponent)] sgn(v)``. At rest the friction force is at most ``mu_s N``.

    The force falls to the dynamic value far more slowly than that of :class:`Stribeck`: with the exponent 2, one per
    cent of the difference remains at ten times the Stribeck velocity.

    Attributes:
        mu: dynamic coefficient of friction [1], reached at speeds far above `v_stribeck`.
        mu_s: static coefficient of friction [1]; None ties it to `mu`, which gives Coulomb's law.
        v_stribeck: Stribeck velocity [m/s], at which half of the difference remains.
        exponent: shape of the fall [1].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Lorentzian(mu=0.2, mu_s=0.25, v_stribeck=5e-3)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4998, 2.1   ], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "mu_s": MU_S,
        "v_stribeck": V_STRIBECK,
        "exponent": positive("", "shape of the fall: 2 Lorentzian"),
    }
    source: ClassVar[str] = "D. P. Hess and A. Soom, J. Tribol. 112 (1990)"
    identifies: ClassVar[str] = (
        "mu less well than in Stribeck's law, because the fall has a long tail; mostly the product (mu_s - mu) "
        "v_stribeck^2, but mu_s and v_stribeck separately if v_stribeck is not far below the speeds of the run; "
        "exponent hardly ever."
    )

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    v_stribeck: Scalar = eqx.field(converter=scalar, default=1e-3)
    exponent: Scalar = eqx.field(converter=scalar, default=2.0)

    def remaining(self, speed: Values) -> Values:
        ratio = speed / self.v_stribeck
        # At both ends the power rule multiplies zero by infinity; insert the known limits.
        regular = (ratio > 0) & (ratio < 1e20)
        fall = jax.nn.sigmoid(-self.exponent * jnp.log(jnp.where(regular, ratio, 1.0)))
        return jnp.where(regular, fall, jnp.where(ratio > 0, 0.0, 1.0))
