"""The Stribeck ridge: of a fall of friction that is over at low speed, a run tells a single combination well.

Where friction falls from static to dynamic far below the speeds of the run, each reversal loses the extra work
``(mu_s - mu) N (v_stribeck^2/2) (1/|a-| + 1/|a+|)`` (Gaussian fall; ``a-`` and ``a+`` the accelerations before and
after it) and shifts the motion in time. The mu and the damping of a fit take up part of both; what is left tells
``mu_s - mu`` times a power of ``v_stribeck`` that follows from the information matrix.
"""

from typing import TYPE_CHECKING, NamedTuple

import jax
import numpy as np

from ..fitting.derived import Estimate
from ..oscillator.leaves import leaves_of

if TYPE_CHECKING:
    from .information import Information

WORK = 2.0
"""Power of the Stribeck velocity in the extra work of a reversal."""


class Ridge(NamedTuple):
    """One law that falls from static to dynamic friction: its coefficients by name and their values.

    Attributes:
        mu, mu_s, v_stribeck: names of the coefficients.
        fall: mu_s - mu [1].
        speed: Stribeck velocity [m/s].
    """

    mu: str
    mu_s: str
    v_stribeck: str
    fall: float
    speed: float

    def text(self, power: float) -> str:
        """The combination with that power of the Stribeck velocity."""
        return f"({self.mu_s} - {self.mu}) {self.v_stribeck}^{power:.3g}"

    def estimate(self, found: "Information", power: float) -> Estimate:
        """The same with its expected standard error."""
        value = self.fall * self.speed**power
        slopes = {self.mu_s: 1 / self.fall, self.mu: -1 / self.fall, self.v_stribeck: power / self.speed}
        return Estimate(value, value * found.std_of(slopes), f"(m/s)^{power:.3g}")

    def best_power(self, found: "Information") -> float:
        """The power of the combination that the run tells best."""
        for direction in found.singular:
            change = dict(zip(direction.names, direction.changes, strict=True))
            if {self.mu_s, self.v_stribeck} <= set(change):
                fall = change[self.mu_s] - change.get(self.mu, 0.0)
                return float(-fall / self.fall * self.speed / change[self.v_stribeck])
        speed = found.names.index(self.v_stribeck)
        among = np.array([(name == self.mu_s) - float(name == self.mu) for name in found.names])
        shared = among @ found.inverse[:, speed]
        return float(-shared / self.fall * self.speed / found.inverse[speed, speed])


def ridges_of(found: "Information") -> tuple[Ridge, ...]:
    """The laws of which both the static coefficient and the Stribeck velocity are to be fitted."""
    flat, by_path = jax.tree.leaves(found.oscillator), {leaf.dotted: leaf for leaf in leaves_of(found.oscillator)}
    made = []
    for path, leaf in by_path.items():
        law, _, kind = path.rpartition(".")
        static, dynamic = by_path.get(f"{law}.mu_s"), by_path.get(f"{law}.mu")
        if kind == "v_stribeck" and static and dynamic:
            fall, speed = (float(flat[static.index]) - float(flat[dynamic.index]), float(flat[leaf.index]))
            made.append(Ridge(dynamic.name, static.name, leaf.name, fall, speed))
    free = set(found.names) - set(found.idle)
    return tuple(ridge for ridge in made if {ridge.mu_s, ridge.v_stribeck} <= free and ridge.fall)


def combinations(found: "Information") -> dict[str, Estimate]:
    """For each of these laws the combination that the run tells best, and that of the work lost at a reversal."""
    told = [(ridge, power) for ridge in ridges_of(found) for power in (ridge.best_power(found), WORK)]
    estimates = {ridge.text(power): ridge.estimate(found, power) for ridge, power in told}
    return {text: estimate for text, estimate in estimates.items() if np.isfinite(estimate.std)}
