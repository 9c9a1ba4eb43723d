"""Motions under laws with internal states by SciPy, from the published formulas in plain numbers.

The formulas are written for one stroke at a time, in which the direction of motion is known, so that a rate has no
kink inside of a stroke. The integration restarts at every reversal.
"""

from collections.abc import Callable, Mapping
from math import asinh, exp, inf, log, pi, sin
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp


class Machine(NamedTuple):
    """An oscillator with linear spring and viscous damping, in SI units."""

    mass: float
    stiffness: float
    damping: float
    normal_force: float


class Law(NamedTuple):
    """A law at a given load; `d` is the direction of motion (+1 or -1).

    `rates(v, z, d)` are those of the internal states `z`, `force(v, z, d)` opposes a positive v, and `pulled(d)` are
    the states after a slow pull.
    """

    scale: tuple[float, ...]
    pulled: Callable[[float], tuple[float, ...]]
    rates: Callable[[float, Any, float], tuple[float, ...]]
    force: Callable[[float, Any, float], float]


def _fall(p: Mapping[str, float], load: float) -> Callable[[float], float]:
    static = p.get("mu_s") or p["mu"]
    return lambda v: load * (p["mu"] + (static - p["mu"]) * exp(-((v / p.get("v_stribeck", 1e-3)) ** 2)))


def _brush(p: Mapping[str, float], load: float, alpha: Callable[[float, float, float], float]) -> Law:
    g, kinetic = _fall(p, load), p["mu"] * load
    sigma0, sigma1, sigma2 = (p[f"sigma{i}"] for i in range(3))
    v_damping = p.get("v_damping") or inf

    def rate(v: float, z: float, d: float) -> float:
        return v - alpha(z, d, g(v) / sigma0) * sigma0 * (d * v) * z / g(v)

    def force(v: float, z: Any, d: float) -> float:
        return sigma0 * z[0] + sigma1 * exp(-((v / v_damping) ** 2)) * rate(v, z[0], d) + sigma2 * v

    bend = kinetic / sigma0
    return Law((bend,), lambda d: (d * bend,), lambda v, z, d: (rate(v, z[0], d),), force)


def lugre(p: Mapping[str, float], load: float) -> Law:
    return _brush(p, load, lambda z, d, z_ss: 1.0)


def elasto_plastic(p: Mapping[str, float], load: float) -> Law:
    z_ba = p["breakaway_fraction"] * p["mu"] * load / p["sigma0"]

    def alpha(z: float, d: float, z_ss: float) -> float:
        if abs(z) <= z_ba or z * d <= 0:
            return 0.0
        return 1.0 if abs(z) >= z_ss else 0.5 + 0.5 * sin(pi * (abs(z) - (z_ss + z_ba) / 2) / (z_ss - z_ba))

    return _brush(p, load, alpha)


def _proportional(load: float, mu: float, length: float, rate: Callable[[float, float, float], float]) -> Law:
    """F = mu N zeta with the relative deflection zeta; `rate(v, zeta, d)` is dz/dt with z = length zeta."""
    return Law(
        (1.0,), lambda d: (d,), lambda v, z, d: (rate(v, z[0], d) / length,), lambda v, z, d: mu * load * z[0]
    )  # fmt: skip


def dahl(p: Mapping[str, float], load: float) -> Law:
    def rate(v: float, zeta: float, d: float) -> float:
        w = 1 - zeta * d
        return abs(w) ** p.get("exponent", 1.0) * (1 if w > 0 else -1) * v

    return _proportional(load, p["mu"], p["mu"] * load / p["sigma0"], rate)


def bouc_wen(p: Mapping[str, float], load: float) -> Law:
    n, beta = p.get("n", 1.0), p.get("beta", 1.0)

    def rate(v: float, zeta: float, d: float) -> float:
        return v - beta * (d * v) * abs(zeta) ** (n - 1) * zeta - (1 - beta) * v * abs(zeta) ** n

    return _proportional(load, p["mu"], p["mu"] * load / p["sigma0"], rate)


def rolling(p: Mapping[str, float], load: float) -> Law:
    mu = p["mu"] * (load / p.get("reference_load", 1.0)) ** p.get("load_exponent", 0.0)
    return _proportional(load, mu, p["length"], lambda v, zeta, d: v - d * v * zeta)


def bliman_sorine(p: Mapping[str, float], load: float) -> Law:
    f1, f2 = p["mu1"] * load, p["mu2"] * load
    fast, slow = p["eta"] * p["epsilon"], p["epsilon"]
    return Law(
        (f1, f1),
        lambda d: (d * f1, -d * f2),
        lambda v, xi, d: ((-d * v * xi[0] + f1 * v) / fast, (-d * v * xi[1] - f2 * v) / slow),
        lambda v, xi, d: xi[0] + xi[1],
    )


def _rate_state(p: Mapping[str, float], load: float, ageing: Callable[[float, float], float]) -> Law:
    """State ln(v0 theta/D_c), pulled at v0."""
    a, v0 = p["a"], p["v_reference"]

    def force(v: float, psi: Any, d: float) -> float:
        return a * load * asinh(v / (2 * v0) * exp((p["mu"] + p["b"] * psi[0]) / a))

    return Law((1.0,), lambda d: (0.0,), lambda v, psi, d: (ageing(abs(v), psi[0]),), force)


def rate_state(p: Mapping[str, float], load: float) -> Law:
    v0, length = p["v_reference"], p["slip_distance"]
    return _rate_state(p, load, lambda u, psi: v0 / length * exp(-psi) - u / length)


def rate_state_slip(p: Mapping[str, float], load: float) -> Law:
    v0, length = p["v_reference"], p["slip_distance"]
    return _rate_state(p, load, lambda u, psi: -u / length * (log(u / v0) + psi) if u > 0 else 0.0)


LAWS: dict[str, Callable[[Mapping[str, float], float], Law]] = {
    "LuGre": lugre,
    "ElastoPlastic": elasto_plastic,
    "Dahl": dahl,
    "BoucWen": bouc_wen,
    "Rolling": rolling,
    "BlimanSorine": bliman_sorine,
    "RateState": rate_state,
    "RateStateSlip": rate_state_slip,
}


def reference(
    law_name: str,
    parameters: Mapping[str, float],
    machine: Machine,
    x0: float,
    ts: np.ndarray,
    *,
    rtol: float = 1e-12,
    method: str = "LSODA",
) -> np.ndarray:
    """Displacement [m] at `ts` [s] after a release at rest from `x0` [m], to which the contact was pulled slowly.

    Args:
        law_name: one of :data:`LAWS`.
        parameters: coefficients by the names of the package, every one that has no default here.
        machine: the oscillator.
        x0: displacement at time zero, not zero.
        ts: increasing times from zero on, shape (samples,).
        rtol: relative tolerance; also the absolute one, in units of the amplitude and of steady deflections.
        method: LSODA, Radau or another one of SciPy's.
    """
    law = LAWS[law_name](parameters, machine.normal_force)
    scale = np.array([abs(x0), abs(x0) * np.sqrt(machine.stiffness / machine.mass), *law.scale])
    x, t, y = np.full(ts.shape, float(x0)), 0.0, np.array([x0, 0.0, *law.pulled(np.sign(x0))]) / scale
    while t < ts[-1]:
        at_rest = y * scale
        d = float(np.sign(_acceleration(machine, law, at_rest[0], 0.0, at_rest[2:], 1.0)))
        stroke = _stroke(machine, law, scale, d, (t, ts[-1]), y, {"method": method, "rtol": rtol, "atol": rtol})
        end = stroke.t[-1]
        inside = (ts > t) & (ts <= end)
        x[inside] = stroke.sol(ts[inside])[0] * scale[0] if inside.any() else ()
        t, y = end, np.array([stroke.y[0, -1], 0.0, *stroke.y[2:, -1]])
    return x


def _acceleration(machine: Machine, law: Law, x: float, v: float, z: Any, d: float) -> float:
    return -(machine.stiffness * x + machine.damping * v + law.force(v, z, d)) / machine.mass


def _stroke(
    machine: Machine, law: Law, scale: np.ndarray, d: float, span: tuple, y0: np.ndarray, how: Mapping[str, Any]
) -> Any:
    """From a reversal to the next one, or to the end, in the direction `d`."""

    def field(_t: float, y: np.ndarray) -> np.ndarray:
        x, v, *z = (y * scale).tolist()
        return np.array([v, _acceleration(machine, law, x, v, z, d), *law.rates(v, z, d)]) / scale

    def reversal(_t: float, y: np.ndarray) -> float:
        return y[1]

    reversal.terminal, reversal.direction = True, -d  # type: ignore[attr-defined]
    return solve_ivp(field, span, y0, events=reversal, dense_output=True, **how)
