"""Forward-mode derivatives of a motion against central differences.

The motions include reversals and the stop.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, LuGre, Stribeck, Tanh
from fricjax.oscillator import Exact, Hybrid, Motion, Oscillator, Smooth, restoring, simulate
from fricjax.oscillator.engines import AbstractEngine
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS, central_differences
from tests.tiers import cases

M, K, C, N = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66


class Case(NamedTuple):
    """Machine from named numbers, with at least eight half-cycles."""

    build: Callable[..., Oscillator]
    values: dict[str, float]
    engine: AbstractEngine
    duration: float
    zero: tuple[str, ...] = ()
    at_rest: bool = True  # whether the run includes the stop
    step: float = 1e-5
    sharp: AbstractEngine | None = None  # engine of the differences, if another one has less numerical noise


def coulomb(mass, stiffness, damping, normal_force, mu, mu_s):
    return Oscillator(mass, stiffness, damping, normal_force, Coulomb(mu, mu_s))


def stribeck(mass, stiffness, damping, normal_force, mu, mu_s, v_stribeck, exponent, drag, k3):
    law = Stribeck(mu, mu_s, v_stribeck, exponent)
    return Oscillator(mass, stiffness, damping, normal_force, law, drag=drag, restoring=restoring.Cubic(k3))


def pendulum(mass, stiffness, damping, normal_force, mu, drag):
    return Oscillator(mass, stiffness, damping, normal_force, Coulomb(mu), drag=drag, restoring=restoring.Pendulum())


def tanh(mass, stiffness, damping, normal_force, drag, mu, v_s):
    return Oscillator(mass, stiffness, damping, normal_force, Tanh(mu, v_s), drag=drag)


def lugre(mass, stiffness, damping, normal_force, drag, mu, mu_s, v_stribeck, sigma0, sigma1, sigma2):
    law = LuGre(mu, mu_s, v_stribeck, sigma0, sigma1, sigma2)
    return Oscillator(mass, stiffness, damping, normal_force, law, drag=drag)


RIG = {"mass": M, "stiffness": K, "damping": C, "normal_force": N}
PENDULUM = {"mass": 0.01, "stiffness": 0.5, "damping": 2e-4, "normal_force": 0.4, "mu": 0.1, "drag": 5e-5}
STRIBECK = {**RIG, "mu": 0.03, "mu_s": 0.036, "v_stribeck": 0.02, "exponent": 1.7, "drag": 0.3, "k3": 2e7}
LUGRE = {"mu": 0.03, "mu_s": 0.036, "v_stribeck": 5e-3, "sigma0": 2e4, "sigma1": 60.0, "sigma2": 0.2}
COULOMB = {**RIG, "mu": 0.025, "mu_s": 0.031}
CASES = {
    "exact, released": Case(coulomb, {**COULOMB, "x0": 2e-3}, Exact(64), 0.5, ("mu_s",)),
    "exact, moving": Case(coulomb, {**COULOMB, "x0": -1e-3, "v0": 0.12}, Exact(64), 0.5, ("mu_s",)),
    "hybrid, released": Case(coulomb, {**COULOMB, "x0": 2e-3}, Hybrid(max_half_cycles=32), 0.5, ("mu_s",)),
    "hybrid, Stribeck": Case(stribeck, {**STRIBECK, "x0": 2.4e-3, "v0": 0.0}, Hybrid(max_half_cycles=32), 0.5, ("v0",)),
    "hybrid, moving": Case(stribeck, {**STRIBECK, "x0": -1e-3, "v0": 0.15}, Hybrid(max_half_cycles=32), 0.5),
    "hybrid, pendulum": Case(pendulum, {**PENDULUM, "x0": 1.6, "v0": -1.5}, Hybrid(max_half_cycles=32), 6.0),
    "smooth, Tanh": Case(
        tanh, {**RIG, "drag": 0.3, "mu": 0.025, "v_s": 1e-3, "x0": 2e-3, "v0": 0.05}, Smooth(1e-11), 0.5,
        at_rest=False, step=1e-4, sharp=Smooth(1e-13),
    ),
    "smooth, LuGre": Case(
        lugre, {**RIG, "drag": 0.3, **LUGRE, "x0": 2.2e-3}, Smooth(), 0.5,
        at_rest=False, step=3e-4, sharp=Smooth(1e-15),
    ),
}  # fmt: skip
LOOSE = {"mu_s", "v_stribeck"}


class Trace(NamedTuple):
    """Sampled motion as a function of relative changes of the named numbers."""

    build: Callable[..., Oscillator]
    names: tuple[str, ...]
    scale: jax.Array
    ts: jax.Array
    engine: AbstractEngine

    @classmethod
    def of(cls, case: Case, engine: AbstractEngine) -> "Trace":
        ts, scale = np.linspace(0, case.duration, 251)[1:], np.array(list(case.values.values()))
        return cls(case.build, tuple(case.values), jnp.asarray(scale), jnp.asarray(ts), engine)

    def __call__(self, relative: jax.Array) -> Motion:
        values = dict(zip(self.names, relative * self.scale, strict=True))
        x0, v0 = values.pop("x0"), values.pop("v0", 0.0)
        return simulate(self.build(**values), x0, self.ts, v0=v0, engine=self.engine)


# Cases that differ only in numbers share these programs. They take one direction at a time, because the batched
# Jacobian of a long loop takes seconds to compile.
pushed = eqx.filter_jit(lambda run, p, tangent: jax.jvp(lambda q: run(q), (p,), (tangent,)))
positions = eqx.filter_jit(lambda run, p: run(p).x)


@pytest.fixture(scope="module", params=cases(CASES, ["exact, released"]))
def case(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]


def test_derivatives_agree_with_differences(case: Case):
    ones = jnp.ones(len(case.values))
    columns = [pushed(Trace.of(case, case.engine), ones, tangent) for tangent in jnp.eye(ones.size)]
    motion, jacobian = columns[0][0], np.array([tangent.x for _, tangent in columns])
    assert (motion.n_half_cycles >= 8) & (bool(motion.at_rest[-1]) == case.at_rest)
    reference = Trace.of(case, case.sharp or case.engine)
    differences, _ = central_differences(lambda p: positions(reference, p), ones, case.step)
    error = np.linalg.norm(jacobian - differences, axis=1) / np.linalg.norm(jacobian, axis=1).clip(1e-300)
    errors = dict(zip(case.values, error, strict=True))
    for name in case.zero:
        column = list(case.values).index(name)
        assert np.max(np.abs(jacobian[column])) < 1e-12
        assert np.max(np.abs(differences[column])) < 1e-12
    print({name: f"{value:.1e}" for name, value in errors.items()})
    wrong = {
        name: value
        for name, value in errors.items()
        if name not in case.zero and not value < (1e-5 if name in LOOSE else 1e-6)
    }
    assert not wrong
