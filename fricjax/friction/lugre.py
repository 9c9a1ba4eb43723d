"""LuGre bristle model (Canudas de Wit et al., 1995)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .brush import BRUSH, AbstractBrush
from .coefficient import Coefficient


class LuGre(AbstractBrush):
    """LuGre bristle model.

    ``dz/dt = v - sigma0 |v| z/g(v)``, ``F = sigma0 z + sigma1 dz/dt + sigma2 v``.

    ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]`` is a force [N]. The stiffness and damping of the bristles do
    not scale with the load. Under a small oscillating load at rest the contact creeps, because bristles slip at any
    deflection. Some coefficients, among them those of 1995, return more work than the bristles have stored, see
    :meth:`passive`.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; None ties it to `mu`.
        v_stribeck: Stribeck velocity [m/s].
        sigma0: stiffness of the bristles [N/m].
        sigma1: damping of the bristles [N s/m].
        sigma2: viscous coefficient of the contact [N s/m].
        v_damping: speed over which the damping fades [m/s], ``sigma1 exp(-(v/v_damping)^2)``; None: constant damping.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.LuGre(mu=0.2, mu_s=0.25, v_stribeck=5e-3, sigma0=1e5, sigma1=30.0)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4998, 2.0092], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = BRUSH
    source: ClassVar[str] = (
        "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995); v_damping: H. Olsson et al., Eur. J. Control "
        "4 (1998)"
    )
    identifies: ClassVar[str] = (
        "mu from the half-cycles; sigma0 from the work that each reversal returns and from the ringing at rest; sigma1 "
        "from the decay of the ringing; mu_s and v_stribeck as in Stribeck's law; sigma2 never together with damping, "
        "so fix one of the two."
    )

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    v_stribeck: Scalar = eqx.field(converter=scalar, default=1e-3)
    sigma0: Scalar = eqx.field(converter=scalar, default=1e5)
    sigma1: Scalar = eqx.field(converter=scalar, default=300.0)
    sigma2: Scalar = eqx.field(converter=scalar, default=0.0)
    v_damping: Scalar | None = eqx.field(converter=scalar, default=None)

    def slipping(self, v: Scalar, state: State, load: Scalar) -> Values:
        return jnp.ones(())
