"""Fixed, random and barely moving machines for the table engine."""

from typing import NamedTuple

import numpy as np

import fricjax as fj
from fricjax import friction as fr
from fricjax.oscillator import restoring

MASS, STIFFNESS, LOAD = 2574.0 / (2 * np.pi * 12.6) ** 2, 2574.0, 1.89
DAMPING = 2 * 0.0027 * np.sqrt(STIFFNESS * MASS)
KNOTS = (0.0, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.16)


class Case(NamedTuple):
    """A machine with a release.

    Attributes:
        x0: initial displacement [m or rad].
        free: coefficients of the derivatives.
        half_cycles: largest number of half-cycles.
        loose: whether 0.3 nm on 2 mm are allowed instead of 0.1 nm: an exponent of 0.5, a regularisation width below
            1e-5 of the speed or 1e-5 m/s, or a monotone spline.
    """

    name: str
    oscillator: fj.Oscillator
    x0: float
    free: tuple[str, ...]
    half_cycles: int
    loose: bool = False


def _prototype(law: fr.AbstractFriction, spring: restoring.AbstractRestoring | None = None) -> fj.Oscillator:
    return fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, law, restoring=spring or restoring.Linear())


def _pendulum() -> fj.Oscillator:
    return fj.Oscillator(1.0, 100.0, 0.02, 37.0, fr.Coulomb(0.1), restoring=restoring.Pendulum())


def fixed() -> list[Case]:
    """Return the 17 machines, and four more.

    Two forces of the monotone spline are equal. The derivatives by both have a jump there, so those by others are
    compared; "monotone, no tie" compares all.
    """
    forces = (0.13, 0.122, 0.11, 0.104, 0.1, 0.099, 0.102)
    tied, untied = (*forces[:5], 0.1, 0.102), (*forces[:5], 0.0996, 0.102)
    curve = ("mu", "mu_s", "v_stribeck", "damping", "stiffness")
    cubic, base = restoring.Cubic(3e8), ("mu", "damping", "stiffness")
    makkar = fr.Makkar(gamma1=0.03, gamma2=1e3, gamma3=200.0, gamma4=0.1, gamma5=1e4, gamma6=0.1)
    free = ("gamma1", "gamma2", "gamma3", "gamma4", "gamma6", "stiffness")
    table = ("forces_0", "forces_2", "forces_4", "stiffness")
    power = ("mu", "mu_s", "v_stribeck", "exponent", "stiffness")
    drag = ("mu", "quadratic_drag", "damping", "stiffness")
    prototype = [
        Case("Coulomb", _prototype(fr.Coulomb(0.1)), 2e-3, base, 13),
        Case("Coulomb, rolling", _prototype(fr.Coulomb(0.01)), 2e-3, base, 20),
        Case("viscous", _prototype(fr.Coulomb(0.01) + fr.Viscous(2.0)), 2e-3, ("mu", "sigma2", "stiffness"), 13),
        Case("quadratic drag", _prototype(fr.Coulomb(0.02) + fr.QuadraticDrag(20.0)), 2e-3, drag, 13),
        Case("Stribeck 2", _prototype(fr.Stribeck(0.1, 0.13, 5e-3)), 2e-3, curve, 13),
        Case("Stribeck 0.5", _prototype(fr.Stribeck(0.1, 0.13, 5e-3, 0.5)), 2e-3, power, 13, True),
        Case("Tanh 1e-4", _prototype(fr.Tanh(0.1, 1e-4)), 2e-3, ("mu", "v_s", "damping", "stiffness"), 12),
        Case("Tanh 1e-6", _prototype(fr.Tanh(0.1, 1e-6)), 2e-3, base, 12, True),
        Case("Tanh 1e-4, rolling", _prototype(fr.Tanh(0.01, 1e-4)), 2e-3, base, 20),
        Case("Tanh 1e-6, rolling", _prototype(fr.Tanh(0.01, 1e-6)), 2e-3, base, 20, True),
        Case("Makkar", _prototype(makkar), 2e-3, free, 12),
        Case("Spline", _prototype(fr.Spline(KNOTS, forces)), 2e-3, table, 13),
        Case("MonotoneSpline", _prototype(fr.MonotoneSpline(KNOTS, tied)), 2e-3, (*table[:2], "stiffness"), 13, True),
        Case("Coulomb, cubic", _prototype(fr.Coulomb(0.1), cubic), 2e-3, ("mu", "k3", "damping", "stiffness"), 13),
        Case("Stribeck 2, cubic", _prototype(fr.Stribeck(0.1, 0.13, 5e-3), cubic), 2e-3, (*curve[:3], "k3"), 13),
        Case("pendulum, 1.0 rad", _pendulum(), 1.0, base, 12),
        Case("pendulum, 2.4 rad", _pendulum(), 2.4, base, 11),
    ]
    structural = _prototype(fr.Coulomb(0.02), restoring.Structural(0.01))
    return [
        *prototype,
        Case("monotone, no tie", _prototype(fr.MonotoneSpline(KNOTS, untied)), 2e-3, table, 13, True),
        Case("structural", structural, 2e-3, ("mu", "eta_h", "stiffness"), 13),
        Case("structural, ends before the equilibrium", structural, 2.4e-5, ("mu", "eta_h", "stiffness"), 13),
        Case("pendulum, 3.05 rad", _pendulum(), 3.05, base, 8),
    ]


def random(count: int, seed: int = 1) -> list[Case]:
    """Return random machines with all memoryless laws and all springs.

    Half of the set-valued ones come to rest within the record.
    """
    rng = np.random.default_rng(seed)
    return [_random(rng, i) for i in range(count)]


def _random(rng: np.random.Generator, i: int) -> Case:
    rate, mass, load = 2 * np.pi * 10 ** rng.uniform(0.3, 1.7), 10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(0, 2)
    stiffness = mass * rate**2
    pendulum = rng.random() < 0.15
    x0 = rng.uniform(0.1, 2.6) if pendulum else 10 ** rng.uniform(-4, -2)
    x0 *= rng.choice([-1.0, 1.0])
    # The friction coefficient follows from the dead band, a part of the deflection.
    reach = 2 * np.sin(abs(x0) / 2) if pendulum else abs(x0)
    speed, mu = rate * reach, 10 ** rng.uniform(-2.3, -0.9) * reach * stiffness / load
    springs = (
        (restoring.Linear(), ()),
        (restoring.Linear(), ()),
        (restoring.Cubic(rng.uniform(-0.3, 0.8) * stiffness / x0**2), ("k3",)),
        (restoring.Structural(rng.uniform(1e-3, 2e-2)), ("eta_h",)),
    )
    spring, more = (restoring.Pendulum(), ()) if pendulum else springs[rng.integers(len(springs))]
    kind, law, free, loose = _random_law(rng, mu, speed, load, i)
    damping = rng.choice([0.0, 1.0]) * 2 * 10 ** rng.uniform(-4, -1.7) * np.sqrt(stiffness * mass)
    drag = rng.choice([0.0, 1.0]) * rng.uniform(0.0, 0.1) * mass / reach
    oscillator = fj.Oscillator(mass, stiffness, damping, load, law, restoring=spring, drag=drag)
    names = (*free, *more, "stiffness", *(("damping",) if damping else ()))[:7]
    most = int(rng.integers(6, 24)) if rng.random() < 0.5 else 60
    return Case(f"{i} {kind}, {type(spring).__name__}", oscillator, x0, names, most, loose)


def _random_law(
    rng: np.random.Generator, mu: float, speed: float, load: float, i: int
) -> tuple[str, fr.AbstractFriction, tuple[str, ...], bool]:
    """Return name, law, free coefficients, and whether the case is loose.

    `speed` is the largest speed of the motion [m/s].
    """
    static, scale = mu * rng.uniform(1.02, 1.5), speed * 10 ** rng.uniform(-2, -0.3)
    exponent = (2.0, 1.0, 0.5)[i % 3]
    width = speed * 10 ** rng.uniform(-5.5, -2)
    knots = (0.0, *np.sort(speed * 10 ** rng.uniform(-2, 0, 5)))
    forces = mu * rng.uniform(0.9, 1.3, 6)
    laws = (
        (fr.Coulomb(mu), ("mu",), False),
        (fr.Coulomb(mu, static), ("mu",), False),
        (fr.Stribeck(mu, static, scale, exponent), ("mu", "mu_s", "v_stribeck", "exponent"), exponent < 1),
        (fr.Lorentzian(mu, static, scale, exponent), ("mu", "mu_s", "v_stribeck", "exponent"), exponent < 1),
        (fr.Tanh(mu, width), ("mu", "v_s"), width < 1e-5 * max(speed, 1.0)),
        (fr.Makkar(0.3 * mu, 10 / scale, 1 / scale, mu, 30 / scale), ("gamma1", "gamma3", "gamma4"), False),
        (fr.Spline(knots, forces), ("forces_0", "forces_2", "forces_4"), False),
        (fr.MonotoneSpline(knots, forces), ("forces_0", "forces_2", "forces_4"), True),
        (fr.LoadDependent(mu, 2 / 3, load / 2, 0.1 * mu * load), ("mu", "exponent", "adhesion"), False),
        (fr.Coulomb(mu) + fr.Viscous(0.05 * mu * load / speed), ("mu", "sigma2"), False),
        (
            fr.Stribeck(mu, static, scale) + fr.QuadraticDrag(0.1 * mu * load / speed**2),
            ("mu", "quadratic_drag"),
            False,
        ),
    )
    law, names, loose = laws[i % len(laws)]
    return fr.base.law_name(law), law, names, loose


def grazing(count: int, seed: int = 5) -> list[Case]:
    """Return Stribeck releases, half of them barely beyond the static dead band."""
    rng, cases = np.random.default_rng(seed), []
    for i in range(count):
        exponent, static = (2.0, 1.0, 0.5)[i % 3], 0.1 * rng.uniform(1.05, 1.6)
        law = fr.Stribeck(0.1, static, 10 ** rng.uniform(-3.3, -1.7), exponent)
        band = static * LOAD / STIFFNESS
        x0 = band * (rng.uniform(1.02, 8) if i % 2 else 1 + 10 ** rng.uniform(-3, -0.5))
        cases.append(Case(f"{i} exponent {exponent:g}", _prototype(law), x0, ("mu",), 60, exponent < 1))
    return cases
