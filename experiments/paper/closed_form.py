"""The half-cycle map in plain Python, as reference for fricjax.

Between reversals the mass swings about the centre that friction has shifted by x_d = mu N/k. Each half-cycle has the
duration pi/omega_d and multiplies the distance to that centre by -rho, rho = exp(-pi zeta/sqrt(1 - zeta^2)). The
alternating amplitude obeys ``a' = rho a - (1 + rho) x_d`` until it is at most x_s = mu_s N/k. The map uses no engine of
fricjax.
"""

import math
from typing import NamedTuple

from fricjax import Oscillator


class Rest(NamedTuple):
    """Rest position [m], time of the stop [s], and number of half-cycles."""

    x: float
    time: float
    half_cycles: int


class HalfCycleMap(NamedTuple):
    """A linear oscillator under Coulomb friction.

    Attributes:
        omega: undamped angular frequency [rad/s].
        damping_ratio: zeta [1].
        dead_band: x_d [m].
        static_band: x_s [m].
    """

    omega: float
    damping_ratio: float
    dead_band: float
    static_band: float

    @property
    def rho(self) -> float:
        """Decay of the distance to the shifted centre in one half-cycle."""
        return math.exp(-math.pi * self.damping_ratio / math.sqrt(1 - self.damping_ratio**2))

    @property
    def half_period(self) -> float:
        """Duration of a half-cycle [s]."""
        return math.pi / (self.omega * math.sqrt(1 - self.damping_ratio**2))

    def rest(self, x0: float) -> Rest:
        """Compute the end of a release from x0 [m]."""
        a, n = abs(x0), 0
        while a > self.static_band:
            a, n = self.rho * a - (1 + self.rho) * self.dead_band, n + 1
        return Rest(math.copysign(1.0, x0) * (-1) ** n * a, n * self.half_period, n)

    def edge(self, n: int) -> float:
        """Initial displacement [m] above which more than n half-cycles occur."""
        edge = self.static_band
        for _ in range(n):
            edge = (edge + (1 + self.rho) * self.dead_band) / self.rho
        return edge

    def slope(self, n: int) -> float:
        """Slope of the map for releases with n half-cycles."""
        return (-self.rho) ** n

    @property
    def jump(self) -> float:
        """Step of the final displacement at each edge [m]."""
        return (1 + self.rho) * (self.static_band - self.dead_band)


def of(machine: Oscillator) -> HalfCycleMap:
    """Build the map of a machine under Coulomb friction."""
    m, k, c = float(machine.mass), float(machine.stiffness), float(machine.damping)
    law, load = machine.friction, machine.normal_force
    dynamic, static = float(law.dynamic_force(load)), float(law.static_force(load))
    return HalfCycleMap(math.sqrt(k / m), c / (2 * math.sqrt(k * m)), dynamic / k, static / k)
