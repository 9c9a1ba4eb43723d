"""Modified Leuven model (Lampaert et al., 2002).

Bristles slip, with the hysteresis of Maxwell-slip elements.
"""

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import jax.numpy as jnp

from .base import Scalar, State, Values, scalar, scalars, signed_power
from .coefficient import SIGMA1, Coefficient, within
from .elements import BEYOND, STRIBECK_ELEMENTS, AbstractStribeckElements, yielded

# Smallest allowed difference between steady sliding and the last reversal, as a fraction of the steady force.
_ROOM = 0.01
# The deflection counts as returning beyond this excess of r over one; in steady sliding r is one up to rounding.
_AT_STEADY = 1e-9


class Leuven(AbstractStribeckElements):
    """Modified Leuven model.

    ``F = F_h(z) + sigma1 dz/dt + sigma2 v``, ``dz/dt = v [1 - r |r|^(n-1)]``, ``r = (F_h - F_b)/(s(v) - F_b)``.

    ``F_h`` is the hysteresis force of Maxwell-slip elements that follow the mean deflection z of the bristles. ``F_b``
    is its value at the last reversal of the velocity. The force of steady sliding is ``s(v) = sgn(v) g(v)`` with
    ``g(v) = N [mu + (mu_s - mu) exp(-(v/v_stribeck)^2)]``. The elements yield at their shares of the static force. The
    published ratio r has no meaning if the sliding friction has fallen to ``F_b`` since the reversal, so ``F_b`` is
    limited to 99 % of ``g(v)``.

    The states are the deflections of the elements [m], then the force at the last reversal over the stiffness of all
    elements [m], and the direction of the motion since this reversal, as a signed deflection [m].

    Attributes:
        mu: dynamic coefficient of friction [1].
        mu_s: static coefficient of friction [1]; None ties it to `mu`.
        v_stribeck: Stribeck velocity [m/s].
        stiffnesses: stiffness of each element [N/m].
        shares: share of each element but the last in the static force [1]; the last element has the remaining share.
        exponent: n [1], at least one; a larger exponent makes sliding begin more suddenly.
        sigma1: damping of the bristles [N s/m].
        sigma2: viscous coefficient of the contact [N s/m].

    Raises:
        ValueError: the number of shares is not one less than that of stiffnesses, or the shares sum to one or more.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Leuven(
        ...     mu=0.2, mu_s=0.25, v_stribeck=5e-3, stiffnesses=[1e5, 5e4], shares=[0.6],
        ...     exponent=2.0, sigma1=10.0, sigma2=0.0,
        ... )
        >>> speed, load = np.array([1e-4, 1e-2]), np.float64(10.0)  # m/s, N
        >>> np.round(law.sliding_force(speed, load), 4)  # N, of steady sliding
        Array([2.4998, 2.0092], dtype=float64)
    """

    coefficients: ClassVar[Mapping[str, Coefficient]] = {
        **STRIBECK_ELEMENTS,
        "exponent": within(1.0, 100.0, "", "sharpness of the start of sliding"),
        "sigma1": SIGMA1,
    }
    source: ClassVar[str] = (
        "V. Lampaert, J. Swevers and F. Al-Bender, IEEE Trans. Autom. Control 47 (2002); J. Swevers et al., ibid. 45 "
        "(2000)"
    )
    identifies: ClassVar[str] = (
        "mu, mu_s and v_stribeck as in Stribeck's law; stiffnesses, shares and exponent if the last half-cycles lie "
        "within the range of the elements; sigma1 from the ringing at rest; sigma2 never together with damping. Fit "
        "from the release, because only there the state of the contact since the last reversal is known."
    )

    mu: Scalar
    mu_s: Scalar | None
    v_stribeck: Scalar
    stiffnesses: tuple[Scalar, ...]
    shares: tuple[Scalar, ...]
    exponent: Scalar
    sigma1: Scalar
    sigma2: Scalar

    def __init__(
        self, mu: Any, mu_s: Any = None, v_stribeck: Any = 1e-3, stiffnesses: Iterable[Any] = (1e5,),
        shares: Iterable[Any] = (), exponent: Any = 1.0, sigma1: Any = 0.0, sigma2: Any = 0.0,
    ) -> None:  # fmt: skip
        self.mu, self.mu_s, self.v_stribeck = scalar(mu), scalar(mu_s), scalar(v_stribeck)
        self.stiffnesses, self.shares = scalars(stiffnesses), scalars(shares)
        self.exponent, self.sigma1, self.sigma2 = scalar(exponent), scalar(sigma1), scalar(sigma2)

    @property
    def n_states(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return len(self.stiffnesses) + 2

    @property
    def n_modes(self) -> int:
        return 2

    def _limits(self, load: Scalar) -> Values:
        """Deflection at which each element yields [m]."""
        return self.all_shares() * self.static_force(load) / self.springs()

    def _hysteresis(self, state: State, load: Scalar) -> Values:
        """Force F_h of the elements [N]."""
        return jnp.sum(self.springs() * yielded(state[:-2], self._limits(load)))

    def _share_of_steady(self, v: Scalar, state: State, load: Scalar) -> Values:
        """Progress r of the force from last reversal to steady sliding."""
        force = self._hysteresis(state, load)
        # In the step in which the velocity changes sign, the current state is the reversal.
        reversal = jnp.where(state[-1] * v > 0, jnp.sum(self.springs()) * state[-2], force)
        steady = self.limit(jnp.abs(v), load)
        since = jnp.minimum(jnp.sign(v) * reversal, (1 - _ROOM) * steady)
        return (jnp.sign(v) * force - since) / (steady - since)

    def _creep(self, v: Scalar, state: State, load: Scalar) -> Values:
        """Rate dz/dt of the deflection [m/s]."""
        return v * (1 - signed_power(self._share_of_steady(v, state, load), self.exponent))

    def rate(self, v: Scalar, state: State, load: Scalar) -> State:
        return jnp.append(self._creep(v, state, load) * jnp.ones(len(self.stiffnesses)), jnp.zeros(2))

    def force(self, v: Values, state: State, load: Scalar) -> Values:
        return self.force_of(v, state, self.rate(v, state, load), load)

    def force_of(self, v: Values, state: State, rate: State, load: Scalar) -> Values:
        # All elements follow the mean deflection of the bristles, so the first rate applies to all of them.
        return self._hysteresis(state, load) + self.sigma1 * rate[0] + self.sigma2 * v

    def return_map(self, v: Scalar, a: Scalar, state: State, load: Scalar) -> State:
        now = self._hysteresis(state, load) / jnp.sum(self.springs())
        reversal = jnp.where(state[-1] * v < 0, now, state[-2])
        direction = jnp.where(v == 0, state[-1], jnp.sign(v) * self.state_scale(load)[-1])
        return jnp.append(yielded(state[:-2], BEYOND * self._limits(load)), jnp.stack([reversal, direction]))

    def switches(self, v: Scalar, state: State, load: Scalar) -> Values:
        # Beyond r = 1 the deflection returns while the mass moves on, and a yielded element follows it from its limit.
        # Within one step the element would first return from its trial deflection, an error without an estimate.
        returns = 1 + _AT_STEADY - self._share_of_steady(v, state, load)
        return jnp.append(self._limits(load) - jnp.sign(v) * state[:-2], returns)

    def steady_state(self, v: Scalar, direction: Scalar, load: Scalar) -> State:
        strained = self._limits(load) * self.limit(jnp.abs(v), load) / self.static_force(load)
        since = jnp.stack([jnp.zeros(()), self.state_scale(load)[-1]])
        return direction * jnp.append(strained, since)

    def state_scale(self, load: Scalar) -> State:
        rigid = self.static_force(load) / jnp.sum(self.springs())
        return jnp.append(self._limits(load), jnp.stack([rigid, rigid]))
