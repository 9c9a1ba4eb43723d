"""Generalised Maxwell-slip model (Lampaert et al., 2003).

Its elements stick as springs and slip towards a Stribeck curve.
"""

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from .base import Scalar, State, Values, scalar, scalars
from .coefficient import Coefficient, not_negative
from .elements import STRIBECK_ELEMENTS, AbstractStribeckElements


class GeneralisedMaxwellSlip(AbstractStribeckElements):
    """Generalised Maxwell-slip model.

    ``F = sum F_i + sigma2 v``. A sticking element follows ``dF_i/dt = k_i v``, a slipping one
    ``dF_i/dt = sgn(v) C (a_i - F_i/s(v))``.

    An element slips when ``F_i sgn(v)`` has reached ``a_i g(v)``. When the velocity changes its sign, all elements
    stick. Here ``s(v) = sgn(v) g(v)``, and ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]`` is the force of
    steady sliding. Slipping elements follow it with a lag ``g/C``. Stiffnesses and attraction do not scale with the
    load.

    The states are the deflections of the springs [m], then the deflections at which they began to slip [m], zero for an
    element that sticks. The latter are needed because the force does not determine the mode: it falls below
    ``a_i g(v)`` as the mass slows down. Modes change between two steps of the integration, and a step ends at each
    change.

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; None ties it to `mu`.
        v_stribeck: Stribeck velocity [m/s].
        stiffnesses: stiffness of each element [N/m].
        shares: share a_i of each element but the last [1]; the last element has the remaining share.
        attraction: C [N/s], the rate at which the force of a slipping element tends to its steady value.
        sigma2: viscous coefficient of the contact [N s/m].

    Raises:
        ValueError: the number of shares is not one less than that of stiffnesses, or the shares sum to one or more.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.GeneralisedMaxwellSlip(
        ...     mu=0.2, mu_s=0.25, v_stribeck=5e-3, stiffnesses=[1e5, 5e4], shares=[0.6], attraction=1e3, sigma2=0.0
        ... )
        >>> [round(float(share), 3) for share in law.all_shares()]  # the last element carries the rest
        [0.6, 0.4]
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        **STRIBECK_ELEMENTS,
        "attraction": not_negative("N/s", "rate at which slipping elements tend to the force of steady sliding"),
    }
    source: ClassVar[str] = (
        "V. Lampaert, F. Al-Bender and J. Swevers, Physcon (2003); F. Al-Bender et al., IEEE Trans. Autom. Control 50 "
        "(2005)"
    )
    identifies: ClassVar[str] = (
        "mu, mu_s and v_stribeck as in Stribeck's law; stiffnesses and shares as in MaxwellSlip; attraction hardly if "
        "g/C is short against the half-period, and not at all without mu_s; sigma2 never together with damping."
    )

    mu: Scalar
    mu_s: Scalar | None
    v_stribeck: Scalar
    stiffnesses: tuple[Scalar, ...]
    shares: tuple[Scalar, ...]
    attraction: Scalar
    sigma2: Scalar

    def __init__(
        self, mu: Any, mu_s: Any = None, v_stribeck: Any = 1e-3, stiffnesses: Iterable[Any] = (1e5,),
        shares: Iterable[Any] = (), attraction: Any = 100.0, sigma2: Any = 0.0,
    ) -> None:  # fmt: skip
        self.mu, self.mu_s, self.v_stribeck = scalar(mu), scalar(mu_s), scalar(v_stribeck)
        self.stiffnesses, self.shares = scalars(stiffnesses), scalars(shares)
        self.attraction, self.sigma2 = scalar(attraction), scalar(sigma2)

    @property
    def n_states(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return 2 * len(self.stiffnesses)

    @property
    def n_modes(self) -> int:
        return len(self.stiffnesses)

    def _capacity(self, v: Values, load: Scalar) -> Values:
        """Force of each element in steady sliding [N]."""
        return self.all_shares() * self.limit(jnp.abs(v), load)

    def _attracted(self, v: Scalar, z: Values, slip: Values, load: Scalar) -> Values:
        """Rate of the deflection of elements that slip [m/s]."""
        pull = jnp.sign(slip) * self.all_shares() - self.springs() * z / self.limit(jnp.abs(v), load)
        return self.attraction * pull / self.springs()

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        z, slip = jnp.split(state, 2)
        moving = jnp.where(slip != 0, self._attracted(v, z, slip, load), v)
        return jnp.concatenate([moving, jnp.zeros_like(slip)])

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        z, slip = jnp.split(state, 2)
        trial, capacity = self.springs() * z, self._capacity(v, load)
        stuck = jnp.where(v >= 0, jnp.minimum(trial, capacity), jnp.maximum(trial, -capacity))
        return jnp.sum(jnp.where(slip != 0, trial, stuck)) + self.sigma2 * v

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        z, slip = jnp.split(state, 2)
        # If the reversal ends the slip of an element, the element keeps its deflection at the reversal.
        since_reversal = jnp.where(a * v > 0, v / jnp.where(a == 0, 1.0, a), 0.0)
        ends = slip * v < 0
        z = jnp.where(ends, z - since_reversal * self._attracted(v, z, slip, load), z)
        # The deflection at which an element slips, and its rate of change.
        limit, change = jax.jvp(lambda w: jnp.sign(v) * self._capacity(w, load) / self.springs(), (v,), (a,))
        excess, approach = jnp.sign(v) * (z - limit), jnp.abs(v) - jnp.sign(v) * change
        begins = ((slip == 0) | ends) & (excess >= 0) & (v != 0)
        # An element began to slip when the excess was zero, and has kept its deflection since.
        since = jnp.where(approach > 0, excess / jnp.where(approach > 0, approach, 1.0), 0.0)
        yielded = limit - change * since
        kept = jnp.where(ends, 0.0, slip)
        return jnp.concatenate([jnp.where(begins, yielded, z), jnp.where(begins, yielded, kept)])

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        z, slip = jnp.split(state, 2)
        capacity = self._capacity(v, load)
        return jnp.where(slip * v > 0, -capacity, capacity - jnp.sign(v) * self.springs() * z)

    def pulled_state(self, direction: Scalar, load: Scalar) -> State:
        z, _ = jnp.split(self.state_scale(load), 2)
        return direction * jnp.concatenate([z, jnp.zeros_like(z)])

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        z = direction * self._capacity(v, load) / self.springs()
        return jnp.concatenate([z, z])

    def state_scale(self, load: Scalar) -> State:
        z = self.all_shares() * self.dynamic_force(load) / self.springs()
        return jnp.concatenate([z, z])
