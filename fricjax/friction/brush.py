"""Brush models of friction.

Bristles bend under the sliding surface, slip at a force that falls with speed, and damp their motion:
``dz/dt = v - s sigma0 |v| z/g(v)`` and ``F = sigma0 z + sigma1(v) dz/dt + sigma2 v``, with the deflection z [m] and the
force of steady sliding ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]`` [N]. The laws differ in the share s of
slipping bristles. The stiffness and damping of the bristles do not scale with the load.
"""

import abc
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from equinox import AbstractVar

from .base import Scalar, State, Values
from .coefficient import SIGMA0, SIGMA1, Coefficient, positive
from .stribeck_curve import STRIBECK_CURVE, AbstractStribeckCurve

BRUSH: Mapping[str, Coefficient] = {
    **STRIBECK_CURVE,
    "sigma0": SIGMA0,
    "sigma1": SIGMA1,
    "v_damping": positive("m/s", "speed over which the damping of the contact fades; none: constant damping"),
}


class AbstractBrush(AbstractStribeckCurve):
    """Base class of brush models; final classes define the slipping share."""

    sigma0: AbstractVar[Scalar]
    sigma1: AbstractVar[Scalar]
    v_damping: AbstractVar[Scalar | None]

    n_states: ClassVar[int] = 1

    @abc.abstractmethod
    def slipping(self, v: Scalar, state: State, load: Scalar) -> Values:
        """Share of the bristles that slip, between 0 and 1."""

    def contact_damping(self, v: Values) -> Values:
        """Damping sigma1(v) of the contact [N s/m]: ``sigma1 exp(-(v/v_damping)^2)``."""
        return self.sigma1 if self.v_damping is None else self.sigma1 * jnp.exp(-((v / self.v_damping) ** 2))

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        speed = jnp.abs(v)
        return v - self.slipping(v, state, load) * self.sigma0 * speed * state / self.limit(speed, load)

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.force_of(v, state, self.rate(v, state, load), load)

    def force_of(self, v: Values, state: State, rate: State, load: Scalar) -> Values:
        bristles = self.sigma0 * state + self.contact_damping(v) * rate
        return bristles[0] + self.sigma2 * v

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        return jnp.reshape(direction * self.limit(jnp.abs(v), load) / self.sigma0, (1,))

    def state_scale(self, load: Scalar) -> State:
        return jnp.reshape(self.mu * load / self.sigma0, (1,))

    def reach(self, load: Scalar) -> State:
        most = jnp.maximum(self.static_force(load), self.dynamic_force(load))
        return jnp.reshape(most / self.sigma0, (1,))

    def passive(self, load: float) -> bool:
        """Return True if no path can return more work than stored.

        With the stored energy ``sigma0 z^2/2``, one of two conditions at every speed is sufficient (F_s is the static
        force): ``sigma1(v) (F_s - g(v))/g(v) <= sigma2``, or ``sigma1(v)^2 |v| <= 4 (sigma1(v) + sigma2) g(v)``. For
        constant sigma1 the first condition is ``sigma2 >= sigma1 (mu_s - mu)/mu`` at high speed, and then it is also
        necessary (Barabanov and Ortega, 2000). The second condition with sigma2 = 0 is that of Olsson (1996).
        """
        scales = [float(scale) for scale in (self.v_stribeck, self.v_damping) if scale is not None]
        speed = jnp.geomspace(1e-4 * min(scales), 1e2 * max(scales), 4001)
        damping, limit = self.contact_damping(speed), self.limit(speed, jnp.asarray(load))
        static, sigma2 = self.static_force(jnp.asarray(load)), float(self.sigma2)
        by_bound = damping * (static - limit) <= sigma2 * limit
        by_storage = damping**2 * speed <= 4 * (damping + sigma2) * limit
        return bool(jnp.all(by_bound | by_storage)) and sigma2 >= self._least_sigma2

    @property
    def _least_sigma2(self) -> float:
        """Smallest sigma2 for which fast sliding returns no work [N s/m]."""
        if self.mu_s is None or self.v_damping is not None:
            return 0.0
        return float(self.sigma1 * (self.mu_s - self.mu) / self.mu)

    def warnings(self, load: float) -> tuple[str, ...]:
        if self.passive(load):
            return ()
        name, least = type(self).__name__, self._least_sigma2
        if self.sigma2 < 0:
            reason, remedy = f"sigma2 = {self.sigma2:g} N s/m is negative", "Raise sigma2 to zero or above."
        elif self.sigma2 < least:
            reason = f"sigma2 = {self.sigma2:g} N s/m is below sigma1 (mu_s - mu)/mu = {least:.4g} N s/m"
            remedy = "Raise sigma2, lower sigma1, or let sigma1 fade with speed by v_damping."
        else:
            reason = f"sigma1 = {self.sigma1:g} N s/m fades too slowly with v_damping = {self.v_damping:g} m/s"
            remedy = "Lower sigma1 or v_damping, or raise sigma2."
        return (f"With these coefficients {name} can give back more work than it took in: {reason}. {remedy}",)
