"""Coulomb friction with its jump smoothed by a hyperbolic tangent."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .coefficient import MU, Coefficient, positive
from .coulomb import Coulomb
from .kinds import AbstractSmooth


class Tanh(AbstractSmooth):
    """Coulomb friction without a jump, ``F = mu N tanh(v/v_s)``.

    The mass never rests. After the last reversal it creeps towards the equilibrium of the spring with the time constant
    ``mu N/(k v_s)``. Choose ``v_s`` below the resolution divided by the duration of the record, or exclude the rest
    from the fit.

    Attributes:
        mu: dynamic coefficient of friction [1].
        v_s: regularisation width [m/s].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Tanh(mu=0.2, v_s=1e-4)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([1.5232, 2.    ], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "v_s": positive("m/s", "width of the regularisation"),
    }
    source: ClassVar[str] = "Regularisation of Coulomb's law, after S. Andersson et al., Tribol. Int. 40 (2007)"
    identifies: ClassVar[str] = (
        "mu as in Coulomb's law; v_s from the creep after the last reversal, unless v_s is only a numerical device."
    )

    mu: Scalar = eqx.field(converter=scalar)
    v_s: Scalar = eqx.field(converter=scalar)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.mu * load * jnp.tanh(v / self.v_s)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.mu * load * jnp.tanh(speed / self.v_s)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return self.v_s

    def set_valued_limit(self) -> Coulomb:
        return Coulomb(self.mu)
