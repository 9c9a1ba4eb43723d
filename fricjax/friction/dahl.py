"""Dahl's model: friction as the stress-strain curve of a yielding material (1968)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, scalar, signed_power
from .coefficient import MU_BRISTLE, SIGMA0, Coefficient, within
from .kinds import AbstractDeflection


class Dahl(AbstractDeflection):
    """Dahl's model of friction with presliding.

    ``dF/dt = sigma0 |w|^exponent sgn(w) v`` with ``w = 1 - sgn(v) F/(mu N)``.

    With the exponent 1 the deflection z = F/sigma0 follows ``dz/dt = v - sigma0 |v| z/(mu N)``, and the force changes
    exponentially over the length mu N/sigma0. An exponent below 1 would have no bounded slope at full sliding.

    Attributes:
        mu: dynamic coefficient of friction [1].
        sigma0: stiffness of the contact before it slides [N/m], independent of the load.
        exponent: shape of the yielding [1], between 1 and 2; 1: like a ductile material.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Dahl(mu=0.2, sigma0=1e5)
        >>> load = np.float64(10.0)
        >>> [float(1e6 * z) for z in law.state_scale(load)]  # um of presliding before the contact slides
        [20.0]
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU_BRISTLE,
        "sigma0": SIGMA0,
        "exponent": within(1.0, 2.0, "", "shape of the yielding; 1: exponential"),
    }
    source: ClassVar[str] = "P. R. Dahl, Aerospace Corporation TOR-0158 (1968); AIAA J. 14 (1976)"
    identifies: ClassVar[str] = (
        "mu from the half-cycles; sigma0 from the work that each reversal returns and from the ringing at rest; "
        "exponent only if the length mu N/sigma0 is not small against the half-cycles."
    )

    mu: Scalar = eqx.field(converter=scalar)
    sigma0: Scalar = eqx.field(converter=scalar)
    exponent: Scalar = eqx.field(converter=scalar, default=1.0)

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return v * signed_power(1 - jnp.sign(v) * state / self.settling_length(load), self.exponent)

    def settling_length(self, load: Scalar) -> Scalar:
        return self.mu * load / self.sigma0

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load
