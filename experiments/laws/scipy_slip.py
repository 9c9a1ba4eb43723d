"""Event-driven motions under laws with elements that stick and slip.

This module does not use fricjax. Under Maxwell-slip friction the oscillator is linear between two events: an element
that yields, or a reversal. Each piece of the motion is thus a damped wave in closed form, and its crossings are the
events.
"""

import dataclasses

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


@dataclasses.dataclass(frozen=True)
class Wave:
    """A damped wave about a rest position.

    `x` and `v` are displacement and velocity at time zero.
    """

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
        """Find the time at which the displacement passes `goal`, before `latest`."""
        return float(brentq(lambda t: float(self.position(t)) - goal, 0.0, latest, xtol=1e-16, rtol=1e-15))  # type: ignore[arg-type]

    def reversal(self) -> float:
        """Return the time of the next zero of the velocity."""
        y, slope = self.x - self.rest, (self.v + self.decay * (self.x - self.rest)) / self.omega
        by_cos, by_sin = slope * self.omega - self.decay * y, -y * self.omega - self.decay * slope
        if self.v == 0:
            return np.pi / self.omega
        return float(np.arctan2(by_cos, -by_sin) % np.pi) / self.omega


def maxwell_slip(
    ts: np.ndarray, x0: float, *, mass: float, stiffness: float, damping: float, stiffnesses: np.ndarray,
    forces: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Compute the displacement at `ts` after a slow pull to `x0`.

    The elements yield at `forces` [N].
    """
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
            # Within a half-cycle the displacement is monotone, so each element yields at most once.
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


def event_driven(ts: np.ndarray, y: np.ndarray, law: "GMSContact | LeuvenContact", rtol: float) -> np.ndarray:
    """Integrate a motion between switches of a law.

    The law gives ``rates(y)``, ``watched(y)`` and ``change(y, which)``. The watched quantities are positive between two
    events. At an event one of them falls to zero, and ``change`` sets the new mode of the elements. Components are
    scaled by ``law.scale``.

    Returns:
        First component of the motion at `ts`.
    """
    found, t = np.full(ts.shape, y[0]), 0.0
    while t < ts[-1]:
        events = [_falling(law, i) for i in range(law.watched(y).size)]
        # A trial step may diverge before it is refused.
        with np.errstate(all="ignore"):
            piece = solve_ivp(
                lambda _t, u: law.rates(u * law.scale) / law.scale, (t, ts[-1] + 1e-3), y / law.scale,
                method="DOP853", rtol=rtol, atol=rtol, events=events, dense_output=True,
            )  # fmt: skip
        inside = (ts >= t) & (ts < piece.t[-1])
        found[inside] = piece.sol(ts[inside])[0] * law.scale[0] if inside.any() else ()
        t, y = piece.t[-1], piece.y[:, -1] * law.scale
        which = int(np.argmax([np.size(at) for at in piece.t_events]))
        y = law.change(y, which)
    return found


def _falling(law: "GMSContact | LeuvenContact", i: int):
    def event(_t: float, u: np.ndarray) -> float:
        return law.watched(u * law.scale)[i]

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


class GMSContact:
    """Elements after Lampaert (2003) on a mass with a spring.

    The state y holds x, v and the force of each element.
    """

    def __init__(
        self, x0: float, *, mass: float, stiffness: float, damping: float, kinetic: float, static: float,
        v_stribeck: float, stiffnesses: np.ndarray, shares: np.ndarray, attraction: float,
    ) -> None:  # fmt: skip
        self.mass, self.stiffness, self.damping = mass, stiffness, damping
        self.kinetic, self.static, self.v_stribeck = kinetic, static, v_stribeck
        self.stiffnesses, self.shares, self.attraction = stiffnesses, shares, attraction
        self.start = np.concatenate([[x0, 0.0], np.sign(x0) * shares * kinetic])
        self.scale = np.concatenate([[abs(x0), abs(x0) * np.sqrt(stiffness / mass)], shares * kinetic])
        self.direction, self.slips = -np.sign(x0), np.zeros(shares.size, bool)

    def steady(self, v: float) -> float:
        return self.kinetic + (self.static - self.kinetic) * np.exp(-((v / self.v_stribeck) ** 2))

    def rates(self, y: np.ndarray) -> np.ndarray:
        x, v, forces = y[0], y[1], y[2:]
        pull = self.attraction * (self.direction * self.shares - forces / self.steady(v))
        a = -(self.stiffness * x + self.damping * v + forces.sum()) / self.mass
        return np.concatenate([[v, a], np.where(self.slips, pull, self.stiffnesses * v)])

    def watched(self, y: np.ndarray) -> np.ndarray:
        room = self.shares * self.steady(y[1]) - self.direction * y[2:]
        return np.concatenate([[self.direction * y[1]], np.where(self.slips, 1.0, room)])

    def change(self, y: np.ndarray, which: int) -> np.ndarray:
        y = y.copy()
        if which == 0:
            y[1], self.direction, self.slips = 0.0, -self.direction, np.zeros(self.shares.size, bool)
        else:
            self.slips[which - 1] = True
            y[1 + which] = self.direction * self.shares[which - 1] * self.steady(y[1])
        return y


class LeuvenContact:
    """The modified Leuven model (Lampaert 2002).

    The state y holds x, v and the force of each element of the hysteresis.
    """

    def __init__(
        self, x0: float, *, mass: float, stiffness: float, damping: float, kinetic: float, static: float,
        v_stribeck: float, stiffnesses: np.ndarray, shares: np.ndarray, exponent: float, sigma1: float,
    ) -> None:  # fmt: skip
        self.mass, self.stiffness, self.damping = mass, stiffness, damping
        self.kinetic, self.static, self.v_stribeck = kinetic, static, v_stribeck
        self.stiffnesses, self.forces, self.exponent, self.sigma1 = stiffnesses, shares * static, exponent, sigma1
        self.start = np.concatenate([[x0, 0.0], np.sign(x0) * shares * kinetic])
        self.scale = np.concatenate([[abs(x0), abs(x0) * np.sqrt(stiffness / mass)], self.forces])
        self.direction, self.yielded = -np.sign(x0), np.zeros(shares.size, bool)
        self.reversal = float(np.sign(x0) * kinetic)

    def creep(self, y: np.ndarray) -> float:
        steady = self.kinetic + (self.static - self.kinetic) * np.exp(-((y[1] / self.v_stribeck) ** 2))
        ratio = (self.direction * (y[2:].sum() - self.reversal)) / (steady - self.direction * self.reversal)
        return y[1] * (1 - np.sign(ratio) * np.abs(ratio) ** self.exponent)

    def rates(self, y: np.ndarray) -> np.ndarray:
        creep = self.creep(y)
        resisting = self.stiffness * y[0] + self.damping * y[1] + y[2:].sum() + self.sigma1 * creep
        return np.concatenate([[y[1], -resisting / self.mass], np.where(self.yielded, 0.0, self.stiffnesses * creep)])

    def watched(self, y: np.ndarray) -> np.ndarray:
        # In steady sliding the bristles stop up to rounding, and the elements keep their state.
        onwards = self.direction * self.creep(y) + 1e-9 * self.scale[1] if self.yielded.any() else 1.0
        room = np.where(self.yielded, 1.0, self.forces - self.direction * y[2:])
        return np.concatenate([[self.direction * y[1], onwards], room])

    def change(self, y: np.ndarray, which: int) -> np.ndarray:
        y = y.copy()
        if which == 0:
            y[1], self.direction, self.reversal = 0.0, -self.direction, float(y[2:].sum())
        if which < 2:
            self.yielded = np.zeros(self.forces.size, bool)
        else:
            # Elements that left their limits together reach them again at the same time.
            at_limit = self.direction * y[2:] >= (1 - 1e-9) * self.forces
            at_limit[which - 2] = True
            self.yielded |= at_limit
            y[2:] = np.where(at_limit, self.direction * self.forces, y[2:])
        return y
