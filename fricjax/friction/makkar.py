"""Smooth law of Makkar et al. (2005).

It imitates static, Stribeck, Coulomb and viscous friction.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar
from .coefficient import Coefficient, check_order, not_negative, positive
from .kinds import AbstractSetValued, AbstractSmooth

_GAMMA1 = not_negative("", "excess of the static over the dynamic coefficient")
_GAMMA3 = positive("s/m", "inverse of the speed over which friction falls")
_GAMMA4 = not_negative("", "dynamic coefficient of friction")
_GAMMA6 = Coefficient("N s/m", "viscous coefficient of the contact")
_SOURCE = "C. Makkar, W. E. Dixon, W. G. Sawyer and G. Hu, IEEE/ASME Int. Conf. Adv. Intell. Mechatron. (2005)"


class MakkarLimit(AbstractSetValued):
    """Set-valued limit of Makkar's law for large gamma2 and gamma5.

    ``F = {N [gamma1 (1 - tanh(gamma3 |v|)) + gamma4] + gamma6 |v|} sgn(v)``.

    Attributes:
        gamma1, gamma3, gamma4, gamma6: as in :class:`Makkar`.
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "gamma1": _GAMMA1,
        "gamma3": _GAMMA3,
        "gamma4": _GAMMA4,
        "gamma6": _GAMMA6,
    }
    source: ClassVar[str] = _SOURCE
    identifies: ClassVar[str] = "gamma1, gamma3 and gamma4 as in Stribeck's law; gamma6 never together with damping."

    gamma1: Scalar = eqx.field(converter=scalar)
    gamma3: Scalar = eqx.field(converter=scalar)
    gamma4: Scalar = eqx.field(converter=scalar)
    gamma6: Scalar = eqx.field(converter=scalar)

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        fallen = 1 - jnp.tanh(self.gamma3 * speed)
        return load * (self.gamma1 * fallen + self.gamma4) + self.gamma6 * speed

    def static_force(self, load: Scalar) -> Scalar:
        return (self.gamma1 + self.gamma4) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.gamma4 * load

    def velocity_scale(self) -> Scalar:
        return 1 / self.gamma3


class Makkar(AbstractSmooth):
    """Smooth friction law with a Stribeck peak.

    ``F = N [gamma1 (tanh(gamma2 v) - tanh(gamma3 v)) + gamma4 tanh(gamma5 v)] + gamma6 v``.

    The static coefficient is about ``gamma1 + gamma4``, the dynamic one ``gamma4``. As with :class:`Tanh`, the mass
    never rests but creeps back to the equilibrium after its last reversal.

    Attributes:
        gamma1: excess of the static over the dynamic coefficient [1]; the published one includes the load.
        gamma2: inverse of the speed over which the force rises to its static value [s/m]; above `gamma3`.
        gamma3: inverse of the speed over which it falls to its dynamic value [s/m].
        gamma4: dynamic coefficient of friction [1].
        gamma5: inverse of the width with which the jump of the dynamic force is smoothed [s/m].
        gamma6: viscous coefficient of the contact [N s/m].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Makkar(gamma1=0.05, gamma2=1e3, gamma3=200.0, gamma4=0.2, gamma5=1e4)
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([1.563, 2.018], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "gamma1": _GAMMA1,
        "gamma2": positive("s/m", "inverse of the speed over which friction rises from rest"),
        "gamma3": _GAMMA3,
        "gamma4": _GAMMA4,
        "gamma5": positive("s/m", "inverse of the width of the smoothed jump"),
        "gamma6": _GAMMA6,
    }
    source: ClassVar[str] = _SOURCE
    identifies: ClassVar[str] = (
        "gamma4 as mu in Coulomb's law; gamma1 and gamma3 as mu_s - mu and 1/v_stribeck in Stribeck's law; gamma2 and "
        "gamma5 only from the creep after the last reversal; gamma6 never together with damping."
    )

    gamma1: Scalar = eqx.field(converter=scalar)
    gamma2: Scalar = eqx.field(converter=scalar)
    gamma3: Scalar = eqx.field(converter=scalar)
    gamma4: Scalar = eqx.field(converter=scalar)
    gamma5: Scalar = eqx.field(converter=scalar)
    gamma6: Scalar = eqx.field(converter=scalar, default=0.0)

    def __check_init__(self) -> None:
        check_order(self, "gamma3", "gamma2", strict=True)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        hump = jnp.tanh(self.gamma2 * v) - jnp.tanh(self.gamma3 * v)
        return load * (self.gamma1 * hump + self.gamma4 * jnp.tanh(self.gamma5 * v)) + self.gamma6 * v

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self.force(speed, jnp.zeros(0), load)

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.gamma4 * load

    def velocity_scale(self) -> Scalar:
        return 1 / jnp.maximum(self.gamma2, self.gamma5)

    def set_valued_limit(self) -> MakkarLimit:
        return MakkarLimit(self.gamma1, self.gamma3, self.gamma4, self.gamma6)
