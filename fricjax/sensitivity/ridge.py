"""The Stribeck ridge: combinations of static coefficient and Stribeck velocity.

If friction falls from static to dynamic far below the speeds of the run, each reversal loses the extra work
``(mu_s - mu) N (v_stribeck^2/2) (1/|a-| + 1/|a+|)`` (Gaussian fall; ``a-`` and ``a+`` are the accelerations before and
after it) and shifts the motion in time. The mu and the damping of a fit absorb part of both effects. The rest
determines only ``mu_s - mu`` times a power of ``v_stribeck``, which follows from the information matrix.
"""

from typing import NamedTuple

import jax
import numpy as np

from ..oscillator.oscillator import leaves_of
from ..rig import Measured
from .information import Information

WORK = 2.0
"""Power of the Stribeck velocity in the extra work of a reversal."""


class Ridge(NamedTuple):
    """Coefficients of a law that falls from static to dynamic friction.

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
        """Return the combination with that power of the Stribeck velocity, as text."""
        return f"({self.mu_s} - {self.mu}) {self.v_stribeck}^{power:.3g}"

    def estimate(self, information: Information, power: float) -> Measured:
        """Return the combination with its expected standard error."""
        value = self.fall * self.speed**power
        slopes = {self.mu_s: 1 / self.fall, self.mu: -1 / self.fall, self.v_stribeck: power / self.speed}
        return Measured(value, value * information.std_of(slopes), f"(m/s)^{power:.3g}")

    def best_power(self, information: Information) -> float:
        """Return the power of the combination that the run determines best."""
        # In an undetermined direction of the two, the combination is constant.
        for direction in information.singular:
            change = dict(zip(direction.names, direction.changes, strict=True))
            if {self.mu_s, self.v_stribeck} <= set(change):
                fall = change[self.mu_s] - change.get(self.mu, 0.0)
                return float(-fall / self.fall * self.speed / change[self.v_stribeck])
        # Otherwise it has the least variance: the regression of the fall on the speed in the expected covariance.
        speed = information.names.index(self.v_stribeck)
        among = np.array([(name == self.mu_s) - float(name == self.mu) for name in information.names])
        shared = among @ information.inverse[:, speed]
        return float(-shared / self.fall * self.speed / information.inverse[speed, speed])


def ridges_of(information: Information) -> tuple[Ridge, ...]:
    """Return laws with free static coefficient and Stribeck velocity."""
    flat = jax.tree.leaves(information.oscillator)
    by_path = {leaf.dotted: leaf for leaf in leaves_of(information.oscillator)}
    ridges = []
    for path, leaf in by_path.items():
        law, _, kind = path.rpartition(".")
        static, dynamic = by_path.get(f"{law}.mu_s"), by_path.get(f"{law}.mu")
        if kind == "v_stribeck" and static and dynamic:
            fall, speed = (float(flat[static.index]) - float(flat[dynamic.index]), float(flat[leaf.index]))
            ridges.append(Ridge(dynamic.name, static.name, leaf.name, fall, speed))
    free = set(information.names) - set(information.no_effect)
    return tuple(ridge for ridge in ridges if {ridge.mu_s, ridge.v_stribeck} <= free and ridge.fall)


def combinations(information: Information) -> dict[str, Measured]:
    """Return the best combination of each law, and that of the work.

    The work is the extra work at a reversal, see the module.
    """
    estimates = {
        ridge.text(power): ridge.estimate(information, power)
        for ridge in ridges_of(information)
        for power in (ridge.best_power(information), WORK)
    }
    return {text: estimate for text, estimate in estimates.items() if np.isfinite(estimate.std)}
