"""Laws with internal states for SciPy, in plain Python numbers.

They follow the published formulas.
"""

from collections.abc import Callable, Mapping, Sequence
from math import asinh, exp, inf, log, pi, sin
from typing import Any

import numpy as np

from experiments.laws.scipy_motion import Law, Machine, restarted


def _fall(p: Mapping[str, float], load: float) -> Callable[[float], float]:
    static, v_stribeck = p.get("mu_s") or p["mu"], p.get("v_stribeck", 1e-3)
    low, more = load * p["mu"], load * (static - p["mu"])
    return lambda v: low + more * exp(-((v / v_stribeck) ** 2))


def _brush(p: Mapping[str, float], load: float, alpha: Callable[[float, float, float], float]) -> Law:
    g, sigma0, sigma1, sigma2 = _fall(p, load), p["sigma0"], p["sigma1"], p["sigma2"]
    v_damping = p.get("v_damping") or inf

    def act(v: float, z: Sequence[float], d: float) -> tuple[float, float]:
        bend = z[0]
        steady = g(v)
        rate = v - alpha(bend, d, steady / sigma0) * sigma0 * (d * v) * bend / steady
        return sigma0 * bend + sigma1 * exp(-((v / v_damping) ** 2)) * rate + sigma2 * v, rate

    bend = p["mu"] * load / sigma0
    return Law(act, (bend,), lambda d: (d * bend,))


def lugre(p: Mapping[str, float], load: float) -> Law:
    return _brush(p, load, lambda z, d, z_ss: 1.0)


def elasto_plastic(p: Mapping[str, float], load: float) -> Law:
    z_ba = p["breakaway_fraction"] * p["mu"] * load / p["sigma0"]

    def alpha(z: float, d: float, z_ss: float) -> float:
        if abs(z) <= z_ba or z * d <= 0:
            return 0.0
        return 1.0 if abs(z) >= z_ss else 0.5 + 0.5 * sin(pi * (abs(z) - (z_ss + z_ba) / 2) / (z_ss - z_ba))

    return _brush(p, load, alpha)


def _proportional(strength: float, length: float, rate: Callable[[float, float, float], float]) -> Law:
    """Build the law F = strength zeta with the relative deflection zeta.

    `rate(v, zeta, d)` is dz/dt with z = length zeta.
    """
    return Law(lambda v, z, d: (strength * z[0], rate(v, z[0], d) / length), (1.0,), lambda d: (d,))


def dahl(p: Mapping[str, float], load: float) -> Law:
    exponent = p.get("exponent", 1.0)

    def rate(v: float, zeta: float, d: float) -> float:
        w = 1 - zeta * d
        return abs(w) ** exponent * (1 if w > 0 else -1) * v

    return _proportional(p["mu"] * load, p["mu"] * load / p["sigma0"], rate)


def bouc_wen(p: Mapping[str, float], load: float) -> Law:
    n, beta = p.get("n", 1.0), p.get("beta", 1.0)

    def rate(v: float, zeta: float, d: float) -> float:
        return v - beta * (d * v) * abs(zeta) ** (n - 1) * zeta - (1 - beta) * v * abs(zeta) ** n

    return _proportional(p["mu"] * load, p["mu"] * load / p["sigma0"], rate)


def rolling(p: Mapping[str, float], load: float) -> Law:
    mu = p["mu"] * (load / p.get("reference_load", 1.0)) ** p.get("load_exponent", 0.0)
    return _proportional(mu * load, p["length"], lambda v, zeta, d: v - d * v * zeta)


def bliman_sorine(p: Mapping[str, float], load: float) -> Law:
    f1, f2 = p["mu1"] * load, p["mu2"] * load
    fast, slow = p["eta"] * p["epsilon"], p["epsilon"]

    def act(v: float, xi: Sequence[float], d: float) -> tuple[float, float, float]:
        return xi[0] + xi[1], (-d * v * xi[0] + f1 * v) / fast, (-d * v * xi[1] - f2 * v) / slow

    return Law(act, (f1, f1), lambda d: (d * f1, -d * f2))


def _rate_state(p: Mapping[str, float], load: float, ageing: Callable[[float, float], float]) -> Law:
    """Build a law with the state ln(v0 theta/D_c), pulled at v0."""
    mu, a, b, v0 = p["mu"], p["a"], p["b"], p["v_reference"]

    def act(v: float, psi: Sequence[float], d: float) -> tuple[float, float]:
        return a * load * asinh(v / (2 * v0) * exp((mu + b * psi[0]) / a)), ageing(abs(v), psi[0])

    return Law(act, (1.0,), lambda d: (0.0,))


def rate_state(p: Mapping[str, float], load: float) -> Law:
    v0, length = p["v_reference"], p["slip_distance"]
    return _rate_state(p, load, lambda u, psi: v0 / length * exp(-psi) - u / length)


def rate_state_slip(p: Mapping[str, float], load: float) -> Law:
    v0, length = p["v_reference"], p["slip_distance"]
    return _rate_state(p, load, lambda u, psi: -u / length * (log(u / v0) + psi) if u > 0 else 0.0)


def maxwell_slip(p: Mapping[str, Any], load: float) -> Law:
    """Build a law of elements with force limits.

    The force of an element is constant at its limit. Integration steps do not end where an element yields.
    """
    limits, stiffnesses = tuple(load * limit for limit in p["limits"]), tuple(p["stiffnesses"])

    def act(v: float, forces: Sequence[float], d: float) -> tuple[float, ...]:
        elements = zip(forces, limits, stiffnesses, strict=True)
        return sum(forces), *(k * v if d * force < limit else 0.0 for force, limit, k in elements)

    return Law(act, limits, lambda d: tuple(d * limit for limit in limits))


def jenkins(p: Mapping[str, float], load: float) -> Law:
    return maxwell_slip({"limits": (p["mu"],), "stiffnesses": (p["sigma0"],)}, load)


LAWS: dict[str, Callable[[Mapping[str, Any], float], Law]] = {
    "LuGre": lugre,
    "ElastoPlastic": elasto_plastic,
    "Dahl": dahl,
    "BoucWen": bouc_wen,
    "Rolling": rolling,
    "BlimanSorine": bliman_sorine,
    "RateState": rate_state,
    "RateStateSlip": rate_state_slip,
    "MaxwellSlip": maxwell_slip,
    "Jenkins": jenkins,
}


def reference(
    law_name: str, parameters: Mapping[str, float], machine: Machine, x0: float, ts: np.ndarray, **how: Any
) -> np.ndarray:
    """Compute the displacement [m] at `ts` [s] under one of :data:`LAWS`.

    All coefficients without a default here are required. `how` may give `rtol` and `method` of :func:`restarted`.
    """
    return restarted(LAWS[law_name](parameters, machine.normal_force), machine, x0, ts, **how)
