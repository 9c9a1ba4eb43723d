"""Coulomb friction with a static coefficient that grows with dwell time.

The contact grows stronger while the mass rests before the release (Rabinowicz 1958; Kato et al. 1972).
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, scalar
from .coefficient import MU, MU_S, Coefficient, check_order, not_negative, positive
from .kinds import AbstractConstant


class Ageing(AbstractConstant):
    """Coulomb friction with an ageing static contact.

    While the mass slides, ``F = mu N sgn(v)``. At rest the friction force is at most ``mu_s N``. The dwell time before
    the release raises the static coefficient to ``mu_s + beta ln(1 + dwell/dwell_scale)``. At a reversal the contact
    has no time to age, so `mu_s` decides whether the mass moves on.

    Attributes:
        mu: dynamic coefficient of friction [1].
        beta: growth of the static coefficient with the logarithm of the dwell time [1].
        dwell: time of rest under load before the release [s].
        mu_s: static coefficient of friction without dwell [1]; at least `mu`; None ties it to `mu`.
        dwell_scale: dwell time above which the growth is logarithmic [s].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Ageing(mu=0.2, beta=0.01, dwell=100.0)
        >>> load = np.float64(10.0)
        >>> round(float(law.dynamic_force(load)), 3), round(float(law.breakaway_force(load)), 3)  # N
        (2.0, 2.462)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "beta": not_negative("", "growth of the static coefficient with the logarithm of the dwell time"),
        "dwell": not_negative("s", "time of rest before the release"),
        "mu_s": MU_S,
        "dwell_scale": positive("s", "dwell time above which the growth is logarithmic"),
    }
    source: ClassVar[str] = "E. Rabinowicz, Proc. Phys. Soc. 71 (1958); S. Kato, N. Sato, T. Matsubayashi (1972)"
    identifies: ClassVar[str] = (
        "mu as in Coulomb's law; beta not from one trace, but only from runs after different dwell times, by the "
        "initial displacements at which they do or do not break away."
    )

    mu: Scalar = eqx.field(converter=scalar)
    beta: Scalar = eqx.field(converter=scalar)
    dwell: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    dwell_scale: Scalar = eqx.field(converter=scalar, default=1.0)

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    def static_force(self, load: Scalar) -> Scalar:
        # A fit may raise mu above a fixed mu_s.
        return (self.mu if self.mu_s is None else jnp.maximum(self.mu, self.mu_s)) * load

    def breakaway_force(self, load: Scalar) -> Scalar:
        return self.static_force(load) + self.beta * jnp.log1p(self.dwell / self.dwell_scale) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load
