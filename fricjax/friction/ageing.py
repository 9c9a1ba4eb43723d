"""Coulomb friction of a contact that grows stronger while it rests before the release (Rabinowicz; Kato)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, scalar
from .coefficient import MU, MU_S, Coefficient, check_order, not_negative, positive
from .kinds import AbstractConstant


class Ageing(AbstractConstant):
    """``F = mu N sgn(v)`` while sliding; at rest up to ``mu_s N``, and before the release more by the dwell time.

    The static coefficient has grown to ``mu_s + beta ln(1 + dwell/dwell_scale)`` when the mass is released from rest.
    At a reversal the contact has no time to age, so that there `mu_s` itself decides whether the mass moves on.

    Attributes:
        mu: dynamic coefficient of friction [1].
        beta: growth of the static coefficient with the logarithm of the dwell time [1].
        dwell: time of rest under load before the release [s].
        mu_s: static coefficient of friction without dwell [1]; at least `mu`; None ties it to `mu`.
        dwell_scale: dwell time from which the growth is logarithmic [s].

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
        "dwell_scale": positive("s", "dwell time from which the growth is logarithmic"),
    }
    source: ClassVar[str] = "E. Rabinowicz, Proc. Phys. Soc. 71 (1958); S. Kato, N. Sato, T. Matsubayashi (1972)"
    identifies: ClassVar[str] = (
        "mu as Coulomb's law; beta not from one trace, only from the initial displacements at which runs after "
        "different dwell times do or do not break away."
    )

    mu: Scalar = eqx.field(converter=scalar)
    beta: Scalar = eqx.field(converter=scalar)
    dwell: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    dwell_scale: Scalar = eqx.field(converter=scalar, default=1.0)

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    def static_force(self, load: Scalar) -> Scalar:
        # A fit may carry mu past a mu_s that stays where it is.
        return (self.mu if self.mu_s is None else jnp.maximum(self.mu, self.mu_s)) * load

    def breakaway_force(self, load: Scalar) -> Scalar:
        return self.static_force(load) + self.beta * jnp.log1p(self.dwell / self.dwell_scale) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load
