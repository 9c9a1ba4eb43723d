"""Elasto-plastic bristle model (Dupont et al., 2002).

The brush is elastic up to a breakaway deflection.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .brush import BRUSH, AbstractBrush
from .coefficient import Coefficient, fraction


class ElastoPlastic(AbstractBrush):
    """Elasto-plastic bristle model.

    ``dz/dt = v - alpha(z, v) sigma0 |v| z/g(v)``, ``F = sigma0 z + sigma1 dz/dt + sigma2 v``, with g as in LuGre.

    The share alpha of slipping bristles is 0 up to the breakaway deflection ``z_ba = breakaway_fraction mu N/sigma0``,
    and if z and v differ in sign. It is 1 beyond the deflection ``z_ss = g(v)/sigma0`` of steady sliding, and
    ``1/2 + 1/2 sin(pi (|z| - (z_ss + z_ba)/2)/(z_ss - z_ba))`` in between. Below z_ba the contact is a spring that
    never drifts, unlike that of LuGre.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; None ties it to `mu`.
        v_stribeck: Stribeck velocity [m/s].
        sigma0: stiffness of the bristles [N/m].
        sigma1: damping of the bristles [N s/m].
        sigma2: viscous coefficient of the contact [N s/m].
        breakaway_fraction: deflection at which bristles begin to slip as a fraction of mu N/sigma0 [1], between 0
            and 1.
        v_damping: speed over which the damping fades [m/s], ``sigma1 exp(-(v/v_damping)^2)``; None: constant damping.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.ElastoPlastic(mu=0.2, mu_s=0.25, v_stribeck=5e-3, sigma0=1e5)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4998, 2.0092], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        **BRUSH,
        "breakaway_fraction": fraction("deflection at which bristles begin to slip as a fraction of the steady one"),
    }
    source: ClassVar[str] = "P. Dupont et al., IEEE Trans. Autom. Control 47 (2002)"
    identifies: ClassVar[str] = (
        "breakaway_fraction only together with sigma0, from the work that each reversal returns and from the ringing "
        "at rest; the other coefficients as in LuGre."
    )

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    v_stribeck: Scalar = eqx.field(converter=scalar, default=1e-3)
    sigma0: Scalar = eqx.field(converter=scalar, default=1e5)
    sigma1: Scalar = eqx.field(converter=scalar, default=300.0)
    sigma2: Scalar = eqx.field(converter=scalar, default=0.0)
    breakaway_fraction: Scalar = eqx.field(converter=scalar, default=0.7)
    v_damping: Scalar | None = eqx.field(converter=scalar, default=None)

    def _breakaway(self, load: Scalar) -> Scalar:
        return self.breakaway_fraction * self.mu * load / self.sigma0

    def slipping(self, v: Scalar, state: State, load: Scalar) -> Values:
        breakaway, steady = self._breakaway(load), self.limit(jnp.abs(v), load) / self.sigma0
        way = jnp.clip((jnp.abs(state) - breakaway) / (steady - breakaway), 0.0, 1.0)
        # sin^2(pi u/2) equals the formula of the docstring, without rounding error near zero.
        return jnp.where(jnp.sign(state) * jnp.sign(v) > 0, jnp.sin(jnp.pi / 2 * way) ** 2, 0.0)
