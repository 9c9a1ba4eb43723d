"""Every law in fricjax and in SciPy, with its motions."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import fricjax as fj
from experiments.laws import scipy_memoryless as plain
from experiments.laws.scipy_laws import LAWS
from experiments.laws.scipy_motion import Law, Machine, direct, restarted
from experiments.laws.scipy_slip import GMSContact, LeuvenContact, event_driven, maxwell_slip

X0 = 2e-3


class Run(NamedTuple):
    """A release on the prototype machine from `X0`.

    Attributes:
        name: name of the motion.
        load: normal force [N].
        mu: coefficient of friction.
        duration: duration [s].
        rate: sampling rate [1/s].
    """

    name: str
    load: float
    mu: float
    duration: float
    rate: float

    @property
    def machine(self) -> Machine:
        return Machine(0.41068, 2574.0, 0.17557, self.load)

    def times(self, quick: bool) -> np.ndarray:
        return np.arange(round(self.rate * self.duration / (8 if quick else 1))) / self.rate


class Peer(NamedTuple):
    """A SciPy method: name, and displacements for times and a relative tolerance."""

    name: str
    solve: Callable[[np.ndarray, float], np.ndarray]


class Workload(NamedTuple):
    """A law of fricjax with its motion and its SciPy methods.

    Attributes:
        peers: plain odeint and Radau, or restarted methods if these two cannot integrate the law.
        others: methods that use more of the law: its switches, or a closed form between two switches.
        reference: reference motion for all errors.
    """

    law: str
    friction: Any
    run: Run
    peers: tuple[Peer, ...]
    others: tuple[Peer, ...]
    reference: Callable[[np.ndarray], np.ndarray]


SLIDING = Run("sliding", 9.66, 0.05, 0.3, 20e3)
ROLLING = Run("rolling", 1.89, 0.01, 2.0, 5e3)
V_S, SIGMA0, SIGMA1 = 5e-3, 1e5, 284.0
_RIG = {"mass": 0.41068, "stiffness": 2574.0, "damping": 0.17557}
_KNOTS = (0.0, 4e-3, 7e-3, 13e-3, 24e-3, 44e-3, 81e-3, 0.16)
_FORCES = (1.3, 1.29, 1.26, 1.194, 1.066, 1.002, 1.0, 1.02)


def _peer(name: str, way: Callable[..., np.ndarray], law: Law, run: Run, method: str) -> Peer:
    return Peer(name, lambda ts, rtol: way(law, run.machine, X0, ts, rtol=rtol, method=method))


def _by(name: str, law: Law, run: Run, friction: Any) -> Workload:
    """Build the methods of an ordinary differential equation.

    A law that holds the mass by a jump needs restarts at its reversals.
    """
    methods = ("LSODA", "DOP853", "Radau")
    knowing = tuple(_peer(f"{method}, restarted", restarted, law, run, method) for method in methods)
    plain = tuple(_peer(method, direct, law, run, method) for method in ("odeint", "Radau"))
    peers, others = (knowing, ()) if law.static else (plain, knowing)
    # At this tolerance LSODA agrees with Radau to some picometres, and takes a tenth of its time.
    return Workload(name, friction, run, peers, others, lambda ts: restarted(law, run.machine, X0, ts, rtol=1e-12))


def _bristle(name: str, run: Run, coefficients: Mapping[str, float]) -> Workload:
    law = name.split(",")[0]
    return _by(name, LAWS[law](coefficients, run.load), run, getattr(fj.friction, law)(**coefficients))


def _events(friction: Any, run: Run, contact: Callable[[], GMSContact | LeuvenContact]) -> Workload:
    def solve(ts: np.ndarray, rtol: float) -> np.ndarray:
        elements = contact()
        return event_driven(ts, elements.start, elements, rtol)

    peer = Peer("DOP853 between events", solve)
    return Workload(type(friction).__name__, friction, run, (peer,), (), partial(solve, rtol=1e-12))


def _slip(name: str, friction: Any, run: Run, stiffnesses: Sequence[float], limits: Sequence[float]) -> Workload:
    """Build the methods of elements that yield.

    Between two events their motion is a damped wave in closed form.
    """

    def solve(ts: np.ndarray, _rtol: float = 0.0) -> np.ndarray:
        return maxwell_slip(ts, X0, **_RIG, stiffnesses=np.array(stiffnesses), forces=run.load * np.array(limits))

    law = LAWS["MaxwellSlip"]({"stiffnesses": stiffnesses, "limits": limits}, run.load)
    ode = _by(name, law, run, friction)
    return ode._replace(others=(Peer("waves between events", solve), *ode.others), reference=solve)


def _memoryless(run: Run) -> list[Workload]:
    f, c, load, mu = fj.friction, plain.constant, run.load, run.mu
    kinetic, static, mu_s = mu * load, 1.3 * mu * load, 1.3 * mu
    coulomb, stribeck = f.Coulomb(mu), f.Stribeck(mu, mu_s, V_S)
    forces = tuple(mu * force for force in _FORCES)
    smooth, monotone = plain.smoothest(_KNOTS, forces), plain.monotone(_KNOTS, forces)
    laws = {
        "Coulomb": (c(kinetic), coulomb),
        "Coulomb, static": (c(kinetic, static), f.Coulomb(mu, mu_s)),
        "LoadDependent": (c(mu * load ** (2 / 3) + 0.002), f.LoadDependent(mu, 2 / 3, 1.0, 0.002)),
        "Ageing": (c(kinetic, static), f.Ageing(mu, 0.0025, 53.6, mu_s)),
        "Viscous": (c(kinetic, viscous=0.05), coulomb + f.Viscous(0.05)),
        "QuadraticDrag": (c(kinetic, drag=0.05), coulomb + f.QuadraticDrag(0.05)),
        "Stribeck": (plain.stribeck(kinetic, static, V_S), stribeck),
        "Sum": (plain.stribeck(kinetic, static, V_S, 0.05, 0.05), stribeck + f.Viscous(0.05) + f.QuadraticDrag(0.05)),
        "Lorentzian": (plain.lorentzian(kinetic, static, V_S), f.Lorentzian(mu, mu_s, V_S)),
        "Spline": (plain.spline(load, smooth, _KNOTS[1]), f.Spline(_KNOTS, forces)),
        "MonotoneSpline": (plain.spline(load, monotone, _KNOTS[1]), f.MonotoneSpline(_KNOTS, forces)),
        "Tanh": (plain.tanh_law(kinetic, 1e-4), f.Tanh(mu, 1e-4)),
        "Makkar": (
            plain.makkar(load, 0.3 * mu, 1e3, 1e2, mu, 2e3, 0.05), f.Makkar(0.3 * mu, 1e3, 1e2, mu, 2e3, 0.05)
        ),
    }  # fmt: skip
    return [_by(name, law, run, friction) for name, (law, friction) in laws.items()]


def _of_states(run: Run) -> list[Workload]:
    mu = run.mu
    brush = {"mu": mu, "sigma0": SIGMA0, "sigma1": SIGMA1, "sigma2": 0.0}
    fall = {"mu_s": 1.3 * mu, "v_stribeck": V_S}
    age = {"mu": mu, "a": 0.1 * mu, "slip_distance": 2e-6, "v_reference": 1e-6}
    coefficients = {
        "Dahl": {"mu": mu, "sigma0": SIGMA0},
        "Dahl, exponent": {"mu": mu, "sigma0": SIGMA0, "exponent": 1.5},
        "BlimanSorine": {"mu1": 1.5 * mu, "mu2": 0.5 * mu, "eta": 0.3, "epsilon": 1e-6},
        "LuGre": brush,
        "LuGre, v_damping": {**brush, **fall, "v_damping": 0.01},
        "ElastoPlastic": {**brush, **fall, "breakaway_fraction": 0.5},
        "BoucWen": {"mu": mu, "sigma0": SIGMA0, "n": 2.0, "beta": 0.7},
        "Rolling": {"mu": mu, "length": 1e-4, "load_exponent": 1 / 3},
        "RateState": {**age, "b": 0.08 * mu},
        "RateStateSlip": {**age, "b": 0.12 * mu},
    }
    return [_bristle(name, run, values) for name, values in coefficients.items()]


def _of_elements(run: Run) -> list[Workload]:
    f, mu, load = fj.friction, run.mu, run.load
    several, limits = (4e4, 3e4, 2e4, 1e4), tuple(mu * share for share in (0.1, 0.2, 0.3, 0.4))
    stiffnesses, shares = (6e4, 3e4, 1e4), (0.3, 0.3, 0.4)
    elements = {"stiffnesses": np.array(stiffnesses), "shares": np.array(shares)}
    contact = {**_RIG, **elements, "kinetic": mu * load, "static": 1.2 * mu * load, "v_stribeck": 2e-2}
    generalised = f.GeneralisedMaxwellSlip(mu, 1.2 * mu, 2e-2, stiffnesses, shares[:-1], 100.0)
    leuven = f.Leuven(mu, 1.2 * mu, 2e-2, stiffnesses, shares[:-1], 1.5, 20.0)
    return [
        _slip("Jenkins", f.Jenkins(mu, SIGMA0), run, (SIGMA0,), (mu,)),
        _slip("MaxwellSlip", f.MaxwellSlip(several, limits), run, several, limits),
        _events(generalised, run, lambda: GMSContact(X0, **contact, attraction=100.0)),
        _events(leuven, run, lambda: LeuvenContact(X0, **contact, exponent=1.5, sigma1=20.0)),
    ]


def workloads() -> list[Workload]:
    """List every law on both motions."""
    kinds = (_memoryless, _of_states, _of_elements)
    return [work for kind in kinds for pair in zip(kind(SLIDING), kind(ROLLING), strict=True) for work in pair]
