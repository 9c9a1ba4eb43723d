"""Bouc-Wen model of hysteresis, without redundant coefficients (1967, 1976)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, power, scalar
from .coefficient import MU_BRISTLE, SIGMA0, Coefficient, within
from .kinds import AbstractDeflection


class BoucWen(AbstractDeflection):
    """Bouc-Wen model of hysteresis.

    ``F = mu N zeta``, ``l dzeta/dt = v - |zeta|^n (beta |v| sgn(zeta) + (1 - beta) v)``, ``l = mu N/sigma0``.

    The original coefficients A, beta, gamma, F_c and l are redundant; here A = 1 and beta + gamma = 1. With n = 1 and
    beta = 1 the model is Dahl's law. Small loops under a load below mu N do not close: the contact creeps towards that
    load.

    Attributes:
        mu: dynamic coefficient of friction [1].
        sigma0: stiffness of the contact before it slides [N/m], independent of the load.
        n: sharpness of the yielding [1], 1 or more; large for a bilinear contact.
        beta: share of the loss during unloading [1], between 0.5 and 1; 0.5: it unloads along a straight line.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.BoucWen(mu=0.2, sigma0=1e5)
        >>> float(law.dynamic_force(np.float64(10.0)))  # N
        2.0
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU_BRISTLE,
        "sigma0": SIGMA0,
        "n": Coefficient("", "sharpness of the yielding", 1.0),
        "beta": within(0.5, 1.0, "", "share of the loss during unloading; 0.5: it unloads along a straight line"),
    }
    source: ClassVar[str] = "R. Bouc (1967); Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976)"
    identifies: ClassVar[str] = (
        "mu from the half-cycles; sigma0 from the work that each reversal returns and from the ringing at rest; "
        "n and beta only if the length mu N/sigma0 is not small against the half-cycles."
    )

    mu: Scalar = eqx.field(converter=scalar)
    sigma0: Scalar = eqx.field(converter=scalar)
    n: Scalar = eqx.field(converter=scalar, default=1.0)
    beta: Scalar = eqx.field(converter=scalar, default=1.0)

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        zeta = state / self.settling_length(load)
        return v - power(zeta, self.n) * (self.beta * jnp.abs(v) * jnp.sign(zeta) + (1 - self.beta) * v)

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        return state

    def settling_length(self, load: Scalar) -> Scalar:
        return self.mu * load / self.sigma0

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load
