"""Machines and noisy decays from independent oracles, for tests of fits.

Fits share a compiled program if they have the same law, free names and record size. The machines here have the laws
Coulomb, Tanh and LuGre; records of up to 4096 samples have one size.
"""

import dataclasses
import functools

import numpy as np
from scipy.optimize import brentq

from fricjax import Fit, Oscillator, Trace
from fricjax.friction import Coulomb, LuGre, Tanh
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import coulomb_viscous, lugre_motion, tanh_motion

STIFFNESS = 2574.0
FREQUENCY, ZETA = 12.6, 0.0027
X0 = 2e-3
MACHINE = ("mu", "damping", "stiffness")


@dataclasses.dataclass(frozen=True)
class Rig:
    """One of the standard workloads."""

    load: float
    mu: float
    rate: float
    duration: float
    noise: float


RIGS = {
    "rolling": Rig(load=1.89, mu=0.01, rate=5e3, duration=2.0, noise=5e-9),
    "sliding": Rig(load=9.66, mu=0.05, rate=20e3, duration=0.29842, noise=1e-9),  # to 0.1 s after the stop
}
LAWS = ("Coulomb", "Tanh", "LuGre")
V_S, SIGMA0 = 1e-4, 1e5
SIGMA1 = 1.4 * np.sqrt(SIGMA0 * PROTOTYPE_MASS)


def oscillator(rig: Rig, law: str) -> Oscillator:
    friction = {
        "Coulomb": Coulomb(rig.mu),
        "Tanh": Tanh(rig.mu, V_S),
        "LuGre": LuGre(rig.mu, sigma0=SIGMA0, sigma1=SIGMA1),
    }[law]
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, rig.load, friction)


def displacement(rig: Rig, law: str, t: np.ndarray) -> np.ndarray:
    """The motion without noise at times `t`, by an oracle."""
    force = rig.mu * rig.load
    machine = {"mass": PROTOTYPE_MASS, "stiffness": STIFFNESS, "damping": PROTOTYPE_DAMPING, "kinetic": force}
    if law == "Coulomb":
        return coulomb_viscous(t, X0, frequency=FREQUENCY, zeta=ZETA, dead_band=force / STIFFNESS).x
    if law == "Tanh":
        return tanh_motion(t, X0, v_s=V_S, **machine)
    return lugre_motion(t, X0, static=force, v_stribeck=1e-3, sigma=(SIGMA0, SIGMA1, 0.0), **machine)


@functools.cache
def clean(rig: str, law: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and displacements of a workload without noise."""
    t = np.arange(round(RIGS[rig].duration * RIGS[rig].rate)) / RIGS[rig].rate
    return t, displacement(RIGS[rig], law, t)


def noisy(rig: str, law: str, seed: int) -> Trace:
    t, x = clean(rig, law)
    noise = RIGS[rig].noise
    return Trace(t, x + noise * np.random.default_rng(seed).standard_normal(t.size), sigma=noise)


def truth(rig: str, law: str, fit: Fit) -> dict[str, float]:
    """True values of all parameters of `fit`, including its start."""
    values = {"mu": RIGS[rig].mu, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS, "sigma0": SIGMA0}
    return {**values, **_start(rig, law, fit), "offset": 0.0}


def _start(rig: str, law: str, fit: Fit) -> dict[str, float]:
    if "t_release" in fit.names:
        at, position = turning_point(rig, law, fit.values["t_release"])
        return {"t_release": at, "x0": position}
    at = fit.origins[0] + float(fit.runs[0].fixed["t_release"])
    x0, v0 = _state(rig, law, at)
    return {"x0": x0, "v0": v0}


def turning_point(rig: str, law: str, near: float) -> tuple[float, float]:
    """Time and position of the true reversal next to a time."""
    if law == "Coulomb":  # the acceleration jumps at a reversal
        band = RIGS[rig].mu * RIGS[rig].load / STIFFNESS
        decay = coulomb_viscous(np.zeros(1), X0, frequency=FREQUENCY, zeta=ZETA, dead_band=band)
        nearest = int(np.argmin(np.abs(decay.stops - near)))
        return float(decay.stops[nearest]), float(decay.points[nearest])
    width = 1e-3
    speed = lambda at: _state(rig, law, at)[1]
    instant: float = brentq(speed, near - width, near + width, xtol=1e-14)  # type: ignore[assignment]
    return instant, _state(rig, law, instant)[0]


def _state(rig: str, law: str, at: float) -> tuple[float, float]:
    """True position and velocity at a time.

    The velocity comes from finite differences, with the smallest step that rounding allows.
    """
    step = 2e-6
    t = np.array([0.0, at - 2 * step, at - step, at, at + step, at + 2 * step])
    x = displacement(RIGS[rig], law, t)[1:]
    return float(x[2]), float((x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * step))


def coulomb_run(
    x0: float = X0, *, mu: float = 0.05, mu_s: float | None = None, load: float = 9.66, rate: float = 5e3,
    samples: int = 2000, seed: int = 0, noise: float = 1e-9, zeta: float = ZETA, offset: float = 0.0,
    drift: float = 0.0, hold: float = 0.0, scale: float = 1.0,
) -> Trace:  # fmt: skip
    """Coulomb decay of the prototype.

    The default number of samples is always the same, so that fits share one compilation.
    `scale` multiplies the displacement, including its noise.
    """
    t = np.arange(samples) / rate
    band = load / STIFFNESS
    exact = coulomb_viscous(
        t, x0 + offset, frequency=FREQUENCY, zeta=zeta, dead_band=mu * band,
        static_band=None if mu_s is None else mu_s * band, offset=offset, release=hold,
    )  # fmt: skip
    x = exact.x + drift * t + noise * np.random.default_rng(seed).standard_normal(t.size)
    return Trace(t, scale * x, sigma=scale * noise)
