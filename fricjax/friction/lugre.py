"""The LuGre bristle model: sliding surfaces as brushes that bend, slip and stick (Canudas de Wit et al., 1995)."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from .base import AbstractBristle, Scalar, State, Values, scalar
from .coefficient import MU, MU_S, SIGMA0, SIGMA1, SIGMA2, V_STRIBECK, Coefficient, check_order


class LuGre(AbstractBristle):
    """``dz/dt = v - sigma0 |v| z/g(v)``, ``F = sigma0 z + sigma1 dz/dt + sigma2 v``.

    ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]`` is a force [N]; the stiffness and damping of the bristles
    do not scale with the load.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; None ties it to `mu`.
        v_stribeck: Stribeck velocity [m/s].
        sigma0: stiffness of the bristles [N/m].
        sigma1: damping of the bristles [N s/m].
        sigma2: viscous coefficient of the contact [N s/m].
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        "mu": MU,
        "mu_s": MU_S,
        "v_stribeck": V_STRIBECK,
        "sigma0": SIGMA0,
        "sigma1": SIGMA1,
        "sigma2": SIGMA2,
    }
    source: ClassVar[str] = "C. Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995)"
    identifies: ClassVar[str] = (
        "mu, sigma0 from the loss of each reversal and the ringing at rest, sigma1 from its decay; mu_s and v_stribeck "
        "as in Stribeck's law; sigma2 only apart from damping, so fix one."
    )
    n_states: ClassVar[int] = 1

    mu: Scalar = eqx.field(converter=scalar)
    mu_s: Scalar | None = eqx.field(converter=scalar, default=None)
    v_stribeck: Scalar = eqx.field(converter=scalar, default=1e-3)
    sigma0: Scalar = eqx.field(converter=scalar, default=1e5)
    sigma1: Scalar = eqx.field(converter=scalar, default=300.0)
    sigma2: Scalar = eqx.field(converter=scalar, default=0.0)

    def __check_init__(self) -> None:
        check_order(self, "mu", "mu_s")

    def _limit(self, speed: Values, load: Scalar) -> Values:
        if self.mu_s is None:
            return self.mu * load
        return load * (self.mu + (self.mu_s - self.mu) * jnp.exp(-((speed / self.v_stribeck) ** 2)))

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        speed = jnp.abs(v)
        return v - self.sigma0 * speed * state / self._limit(speed, load)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return (self.sigma0 * state + self.sigma1 * self.rate(v, state, load))[0] + self.sigma2 * v

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.reshape(direction * self._limit(jnp.abs(v), load) / self.sigma0, (1,))

    def state_scale(self, load: Scalar) -> State:
        return jnp.reshape(self.mu * load / self.sigma0, (1,))

    def sliding_force(self, speed: Values, load: Scalar) -> Values:
        return self._limit(speed, load) + self.sigma2 * speed

    def static_force(self, load: Scalar) -> Scalar:
        return (self.mu if self.mu_s is None else self.mu_s) * load

    def dynamic_force(self, load: Scalar) -> Scalar:
        return self.mu * load

    def velocity_scale(self) -> Scalar:
        return jnp.asarray(jnp.inf) if self.mu_s is None else self.v_stribeck
