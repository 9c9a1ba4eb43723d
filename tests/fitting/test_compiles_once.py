"""Fits of the same shape compile only once, with every engine."""

import threading

import jax
import numpy as np
import pytest

from fricjax import Oscillator, Record, Trace, fit, synthetic_run
from fricjax.friction import BlimanSorine, Coulomb
from fricjax.oscillator.program import forget_programs
from tests.compilations import compilations
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, coulomb_run, noisy, oscillator


def test_compilations_are_counted():
    with compilations() as first:
        jax.jit(lambda x: x * 3.25 + 1)(np.ones(7)).block_until_ready()
    assert first


def machine(friction, *, mass=PROTOTYPE_MASS, damping=PROTOTYPE_DAMPING):
    return Oscillator(mass, STIFFNESS, damping, 9.66, friction)


def test_exact():
    fit(coulomb_run(), machine(Coulomb(0.05)), MACHINE)
    fit(coulomb_run(mu=0.005), machine(Coulomb(0.05)), MACHINE)
    with compilations() as seen:
        other = machine(Coulomb(0.2), damping=0.3, mass=0.5)
        found = fit(coulomb_run(1.7e-3, seed=4), other, MACHINE, bounds={"mu": (0.0, 1.0)}, priors={"mu": (0.05, 1.0)})
        in_motion = fit(coulomb_run(mu=0.006, seed=2), machine(Coulomb(0.01)), MACHINE)
    assert found.converged and in_motion.converged
    assert not seen


@pytest.mark.slow
def test_hybrid():
    two = machine(Coulomb(0.02) + Coulomb(0.03))
    free, tie = ("friction.0.mu", "damping", "stiffness"), {"friction.1.mu": ("friction.0.mu", 0.5)}
    fit(coulomb_run(), two, free, tie=tie, engine="hybrid")
    with compilations() as seen:
        fit(coulomb_run(1.8e-3, seed=9), machine(Coulomb(0.3) + Coulomb(0.01)), free, tie=tie, engine="hybrid")
    assert not seen


@pytest.mark.slow
@pytest.mark.parametrize("law", ["Tanh"])
def test_smooth(law):
    machine = oscillator(RIGS["sliding"], law)
    fit(noisy("sliding", law, 0), machine, MACHINE)
    with compilations() as seen:
        fit(noisy("sliding", law, 77), machine, MACHINE)
        trace = noisy("sliding", law, 78)
        fit(Trace(trace.t, np.asarray(trace.x) * 0.999, sigma=1.1e-9), machine, MACHINE, throw=False)
    assert not seen


def two_states() -> tuple[Record, Oscillator]:
    """Run and machine for a law of two states.

    The coarsest mesh of the fit has 3000 steps, the finest one 10,000.
    """
    rolling = machine(BlimanSorine(0.014, 0.004, 0.3, 1e-4))
    return synthetic_run(rolling, 1e-3, rate=5e3, duration=1.0, noise=5e-9, seed=0), rolling


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "free"),
    [
        (lambda: (noisy("sliding", "LuGre", 0), oscillator(RIGS["sliding"], "LuGre")), (*MACHINE, "sigma0")),
        (two_states, MACHINE[1:]),
    ],
    ids=["LuGre", "BlimanSorine"],
)
def test_all_meshes_of_a_fit_share_a_program(made, free):
    """Count the programs of a fit with several meshes.

    The meshes range from the coarse one of the first stage to the fine one of the check.
    A background thread compiles the program while the first mesh is computed.
    """
    run, model = made()
    forget_programs()
    with compilations() as seen:
        fit(run, model, free)
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("compiling")]
    assert len([name for name in seen if "solve_in_stages" in name]) == 1, seen


def test_predict_and_report():
    first = fit(coulomb_run(), machine(Coulomb(0.05)), MACHINE)
    first.predict(np.arange(2000) / 5e3)
    second = fit(coulomb_run(seed=3), machine(Coulomb(0.05)), MACHINE)
    with compilations() as seen:
        second.predict(np.arange(2000) / 5e3 + 1e-5)
        second.summary()
    assert not seen
