"""Closed-form motions that no part of the package computes: oracles for tests."""

import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp


@dataclasses.dataclass(frozen=True)
class Decay:
    """Free decay with Coulomb and viscous friction, from rest at `x0`."""

    t: np.ndarray
    x: np.ndarray
    stops: np.ndarray  # instants at which the velocity vanishes, the last one the stop
    points: np.ndarray  # positions there
    half_period: float

    @property
    def n_half_cycles(self) -> int:
        return self.stops.size


def coulomb_viscous(
    t: np.ndarray, x0: float, *, frequency: float, zeta: float, dead_band: float, static_band: float | None = None,
    offset: float = 0.0, release: float = 0.0,
) -> Decay:  # fmt: skip
    """Half-cycles about +-`dead_band`: damped cosines until the spring no longer overcomes `static_band`."""
    static = dead_band if static_band is None else static_band
    omega, root = 2 * np.pi * frequency, np.sqrt(1 - zeta**2)
    half = np.pi / (omega * root)
    tau = np.asarray(t) - release
    y, begin, points = x0 - offset, 0.0, []
    x = np.full(tau.shape, y)
    while abs(y) > static:
        centre = np.sign(y) * dead_band
        inside = (tau >= begin) & (tau < begin + half)
        phase = omega * (tau[inside] - begin)
        wave = np.cos(root * phase) + zeta / root * np.sin(root * phase)
        x[inside] = centre + (y - centre) * np.exp(-zeta * phase) * wave
        y = centre - (y - centre) * np.exp(-np.pi * zeta / root)
        begin += half
        x[tau >= begin] = y
        points.append(y)
    stops = release + half * np.arange(1, len(points) + 1)
    return Decay(np.asarray(t), x + offset, stops, np.array(points) + offset, half)


@dataclasses.dataclass(frozen=True)
class Machine:
    """Oscillator in plain numbers and functions; forces in N for positive arguments."""

    mass: float
    damping: float
    spring: Callable[[float], float]
    sliding: Callable[[float], float]  # friction force against speed >= 0
    static: float
    drag: float = 0.0


@dataclasses.dataclass(frozen=True)
class Slide:
    """Motion of a :class:`Machine` with its reversals.

    The last reversal is the stop if `t_stop` is finite.
    """

    x: np.ndarray
    v: np.ndarray
    times: np.ndarray
    points: np.ndarray
    t_stop: float


def slide(machine: Machine, x0: float, v0: float, ts: np.ndarray, *, rtol: float = 1e-12) -> Slide:
    """Integrate each half-cycle with DOP853.

    The event function of SciPy locates the reversals; the rest condition is checked at each.
    """
    x, v = np.full(ts.shape, float(x0)), np.zeros(ts.shape)
    t, y, speed = 0.0, float(x0), float(v0)
    times, points = [], []
    while speed != 0 or abs(machine.spring(y)) > machine.static:
        direction = np.sign(speed) if speed else -np.sign(y)
        stroke = _stroke(machine, direction, t, (y, speed), ts[-1], rtol, abs(x0) + abs(v0))
        end = stroke.t_events[0][0] if stroke.t_events[0].size else np.inf
        inside = (ts >= t) & (ts < end)
        x[inside], v[inside] = stroke.sol(ts[inside]) if inside.any() else ((), ())
        if not np.isfinite(end):
            return Slide(x, v, np.array(times), np.array(points), np.inf)
        t, y, speed = end, stroke.y_events[0][0][0], 0.0
        x[ts >= t], v[ts >= t] = y, 0.0
        times.append(t)
        points.append(y)
    return Slide(x, v, np.array(times), np.array(points), t)


def _stroke(machine: Machine, direction: float, t: float, y0: tuple, t_end: float, rtol: float, reach: float):
    def rates(_t: float, y: np.ndarray) -> tuple[float, float]:
        speed = direction * y[1]
        resisting = machine.damping * speed + machine.drag * speed * abs(speed) + machine.sliding(max(speed, 0.0))
        return y[1], -(direction * resisting + machine.spring(y[0])) / machine.mass

    def reversal(_t: float, y: np.ndarray) -> float:
        return y[1]

    reversal.terminal, reversal.direction = True, -direction  # type: ignore[attr-defined]
    stop = max(t_end, t) + 1.0
    return solve_ivp(
        rates, (t, stop), y0, method="DOP853", rtol=rtol, atol=1e-3 * rtol * reach, events=reversal, dense_output=True
    )


def lugre_motion(
    t: np.ndarray, x0: float, *, mass: float, stiffness: float, damping: float, kinetic: float, static: float,
    v_stribeck: float, sigma: tuple[float, float, float], rtol: float = 1e-11, bent: float = 1.0,
) -> np.ndarray:  # fmt: skip
    """Displacement under LuGre friction from rest at `x0`, by LSODA.

    `kinetic` and `static` are forces [N].

    The bristles start at `bent` times their deflection after a slow pull.
    """
    scale = np.array([abs(x0), abs(x0) * np.sqrt(stiffness / mass), kinetic / sigma[0]])

    def rates(_t: float, y: np.ndarray) -> np.ndarray:
        x, v, z = y * scale
        limit = kinetic + (static - kinetic) * np.exp(-((v / v_stribeck) ** 2))
        creep = v - sigma[0] * abs(v) * z / limit
        force = sigma[0] * z + sigma[1] * creep + sigma[2] * v
        return np.array([v, -(stiffness * x + damping * v + force) / mass, creep]) / scale

    start = np.array([x0, 0.0, bent * np.sign(x0) * kinetic / sigma[0]]) / scale
    solution = solve_ivp(rates, (0.0, t[-1]), start, method="LSODA", t_eval=t, rtol=rtol, atol=rtol)
    return solution.y[0] * scale[0]


def tanh_motion(
    t: np.ndarray, x0: float, *, mass: float, stiffness: float, damping: float, kinetic: float, v_s: float
) -> np.ndarray:
    """Displacement under the regularised Coulomb force `kinetic` tanh(v/v_s), by DOP853."""

    def rates(_t: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], -(stiffness * y[0] + damping * y[1] + kinetic * np.tanh(y[1] / v_s)) / mass

    return solve_ivp(rates, (0.0, t[-1]), (x0, 0.0), method="DOP853", t_eval=t, rtol=1e-12, atol=1e-15).y[0]
