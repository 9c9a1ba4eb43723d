"""Model of Bliman and Sorine (1995).

The friction force depends only on the path and has a peak as sliding begins.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .coefficient import Coefficient, check_order, fraction, not_negative, positive
from .kinds import AbstractBristle


class BlimanSorine(AbstractBristle):
    """Bliman-Sorine model with a static peak.

    ``F = N [mu1 z1/l1 - mu2 z2/l2]``, ``dz_i/dt = v - |v| z_i/l_i`` with ``l1 = eta epsilon``, ``l2 = epsilon``.

    The force is the difference of a fast, strong contact and a slow, weak one. After a travel s from an unstrained
    state it is ``N [mu1 (1 - exp(-s/(eta epsilon))) - mu2 (1 - exp(-s/epsilon))]``. It has a peak at
    :meth:`peak_travel` and then falls to ``(mu1 - mu2) N``. The static force is this peak. After a reversal the peak is
    twice as far above the dynamic force. With mu2 = 0 this is the model of first order, Dahl's law with the length
    eta epsilon.

    Attributes:
        mu1: coefficient of the fast contact [1]; the dynamic coefficient of friction is mu1 - mu2.
        mu2: coefficient of the slow contact [1], below mu1.
        eta: length of the fast contact as a fraction of that of the slow one [1], between 0 and 1.
        epsilon: travel over which the slow contact reaches its steady force [m].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.BlimanSorine(mu1=0.5, mu2=0.3, eta=0.2, epsilon=1e-5)
        >>> load = np.float64(10.0)
        >>> round(float(law.dynamic_force(load)), 3), round(float(law.static_force(load)), 3)  # N
        (2.0, 3.413)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu1": positive("", "coefficient of the fast contact"),
        "mu2": not_negative("", "coefficient of the slow contact, which is subtracted from mu1"),
        "eta": fraction("length of the fast contact as a fraction of that of the slow one"),
        "epsilon": positive("m", "travel over which the slow contact reaches its steady force"),
    }
    source: ClassVar[str] = "P.-A. Bliman and M. Sorine, Proc. European Control Conference (1995)"
    identifies: ClassVar[str] = (
        "mu1 - mu2 from the half-cycles; the other coefficients only if epsilon is not small against them. With "
        "mu2 = 0 only the product eta epsilon."
    )
    n_states: ClassVar[int] = 2

    mu1: Scalar = eqx.field(converter=scalar)
    mu2: Scalar = eqx.field(converter=scalar)
    eta: Scalar = eqx.field(converter=scalar)
    epsilon: Scalar = eqx.field(converter=scalar)

    def __check_init__(self) -> None:
        check_order(self, "mu2", "mu1", strict=True)

    def _per_load(self, deflections: Values) -> Values:
        """Force per load for deflections as fractions of their steady values."""
        return self.mu1 * deflections[0] - self.mu2 * deflections[1]

    def peak_travel(self) -> Scalar:
        """Travel from an unstrained state to the peak force [m].

        It is infinite for mu2 = 0, because there is no peak.
        """
        excess = jnp.log(self.mu1) - jnp.log(self.eta * self.mu2)
        return self.eta * self.epsilon / (1 - self.eta) * excess

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return v - jnp.abs(v) * state / self.state_scale(load)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return load * self._per_load(state / self.state_scale(load))

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return direction * self.state_scale(load)

    def state_scale(self, load: Scalar) -> State:
        return jnp.stack([self.eta * self.epsilon, self.epsilon])

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.dynamic_force(load) * jnp.ones_like(speed)

    def static_force(self, load: Scalar) -> Scalar:
        return load * self._per_load(-jnp.expm1(-self.peak_travel() / self.state_scale(load)))

    def dynamic_force(self, load: Scalar) -> Scalar:
        return (self.mu1 - self.mu2) * load

    def velocity_scale(self) -> Scalar:
        return jnp.asarray(jnp.inf)
