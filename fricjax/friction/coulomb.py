"""Coulomb friction (Coulomb, 1785).

A constant force opposes the motion, and the static force may be larger.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, scalar
from .coefficient import MU, MU_S, Coefficient, check_order
from .kinds import AbstractConstant


class Coulomb(AbstractConstant):
    """Coulomb friction with an optional static coefficient.

    While the mass slides, ``F = mu N sgn(v)``. At rest the friction force is at most ``mu_s N``.

    The static coefficient decides only whether the mass moves on from a reversal. A trace therefore has no gradient
    with respect to it. The stops and non-stops of a run bracket it, and it is never fitted.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; at least `mu`; None ties it to `mu`.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.2, mu_s=0.25)
        >>> load = np.float64(10.0)
        >>> float(law.dynamic_force(load)), float(law.static_force(load))  # N
        (2.0, 2.5)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {"mu": MU, "mu_s": MU_S}
    source: ClassVar[str] = "C. A. Coulomb, Theorie des machines simples (1785)"
    identifies: ClassVar[str] = (
        "mu from at least two half-cycles, and from about five together with damping; mu_s only as a bracket from "
        "stops and non-stops."
    )

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    def static_force(self, load: Scalar) -> Scalar:
        # A fit may raise mu above a fixed mu_s.
        return (self.mu if self.mu_s is None else jnp.maximum(self.mu, self.mu_s)) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load
