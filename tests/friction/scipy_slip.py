"""Event-driven motions under laws whose elements stick and slip, which no part of the package computes.

Under Maxwell-slip friction the oscillator is linear between two events, an element that yields or a reversal, so
every piece of the motion is a damped wave in closed form, and the events are its crossings.
"""

import dataclasses

import numpy as np
from scipy.optimize import brentq


@dataclasses.dataclass(frozen=True)
class Wave:
    """A damped wave about a rest position, from displacement `x` and velocity `v` at time zero."""

    rest: float
    x: float
    v: float
    decay: float  # [1/s]
    omega: float  # damped angular frequency [1/s]

    def position(self, t: np.ndarray | float) -> np.ndarray:
        y, slope = self.x - self.rest, (self.v + self.decay * (self.x - self.rest)) / self.omega
        phase = self.omega * np.asarray(t)
        return self.rest + np.exp(-self.decay * t) * (y * np.cos(phase) + slope * np.sin(phase))

    def velocity(self, t: np.ndarray | float) -> np.ndarray:
        y, slope = self.x - self.rest, (self.v + self.decay * (self.x - self.rest)) / self.omega
        phase = self.omega * np.asarray(t)
        by_cos, by_sin = slope * self.omega - self.decay * y, -y * self.omega - self.decay * slope
        return np.exp(-self.decay * t) * (by_cos * np.cos(phase) + by_sin * np.sin(phase))

    def time_of(self, goal: float, latest: float) -> float:
        """When the displacement passes `goal` before `latest`."""
        return float(brentq(lambda t: float(self.position(t)) - goal, 0.0, latest, xtol=1e-16, rtol=1e-15))  # type: ignore[arg-type]

    def reversal(self) -> float:
        """Time until the velocity vanishes next."""
        y, slope = self.x - self.rest, (self.v + self.decay * (self.x - self.rest)) / self.omega
        by_cos, by_sin = slope * self.omega - self.decay * y, -y * self.omega - self.decay * slope
        if self.v == 0:
            return np.pi / self.omega
        return float(np.arctan2(by_cos, -by_sin) % np.pi) / self.omega


def maxwell_slip(
    ts: np.ndarray, x0: float, *, mass: float, stiffness: float, damping: float, stiffnesses: np.ndarray,
    forces: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Displacement at `ts` after a slow pull to `x0`, with elements that yield at `forces` [N]."""
    x, v, t = float(x0), 0.0, 0.0
    held, direction = np.sign(x0) * np.asarray(forces, float), -np.sign(x0)
    sticking = np.ones(held.size, bool)
    found = np.full(ts.shape, x)
    while t < ts[-1]:
        k = stiffness + stiffnesses[sticking].sum()
        rest = (stiffnesses[sticking].sum() * x - held.sum()) / k
        decay = damping / (2 * mass)
        wave = Wave(rest, x, v, decay, np.sqrt(k / mass - decay**2))
        end, event = wave.reversal(), -1
        for i in np.flatnonzero(sticking):
            # Within a stroke the displacement is monotone, so each element yields at one crossing.
            goal = x + (direction * forces[i] - held[i]) / stiffnesses[i]
            if direction * (wave.position(end) - goal) > 0:
                end, event = wave.time_of(goal, end), i
        inside = (ts >= t) & (ts < t + end)
        found[inside] = wave.position(ts[inside] - t)
        moved = float(wave.position(end)) - x
        held = np.where(sticking, held + stiffnesses * moved, held)
        x, v, t = x + moved, float(wave.velocity(end)), t + end
        if event < 0:
            v, direction, sticking = 0.0, -direction, np.ones(held.size, bool)
        else:
            sticking[event], held[event] = False, direction * forces[event]
    return found
