"""Start values from a decay, against its true coefficients."""

import numpy as np
import pytest
from scipy.optimize import nnls

from fricjax import Oscillator, Trace
from fricjax.data import segment
from fricjax.fitting.guess import guess_machine
from fricjax.fitting.window import non_negative
from fricjax.friction import Coulomb
from fricjax.oscillator.restoring import Cubic, Pendulum
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import STIFFNESS, coulomb_run
from tests.oracles import Machine, slide

LOAD = 9.66


def guess(trace: Trace, oscillator: Oscillator, *free: str) -> dict[str, float]:
    found = segment(np.asarray(trace.t), np.asarray(trace.x))
    values = {
        name: float(getattr(oscillator, name)) for name in ("mass", "stiffness", "damping", "normal_force", "drag")
    }
    return guess_machine(oscillator, [found], free, {**values, "mu": float(oscillator.friction.mu)})  # type: ignore[attr-defined]


def wrong() -> Oscillator:
    """Machine with coefficients far from the truth."""
    return Oscillator(PROTOTYPE_MASS, 900.0, 3.0, LOAD, Coulomb(0.3))


@pytest.mark.parametrize(("mu", "x0"), [(0.05, 2e-3), (0.02, 2e-3), (0.01, 1e-3), (0.005, 2e-3)])
def test_coulomb_and_viscous_friction(mu, x0):
    found = guess(coulomb_run(x0, mu=mu, samples=4000), wrong(), "mu", "damping", "stiffness")
    assert found["mu"] == pytest.approx(mu, rel=0.03)
    assert found["damping"] == pytest.approx(PROTOTYPE_DAMPING, rel=0.15)
    assert found["stiffness"] == pytest.approx(STIFFNESS, rel=1e-3)


def test_the_mass_in_place_of_the_stiffness_and_the_load_in_place_of_mu():
    start = Oscillator(3.0, STIFFNESS, PROTOTYPE_DAMPING, 1.0, Coulomb(0.05))
    found = guess(coulomb_run(), start, "mass", "normal_force")
    assert found["mass"] == pytest.approx(PROTOTYPE_MASS, rel=1e-3)
    assert found["normal_force"] == pytest.approx(LOAD, rel=0.03)


def test_viscous_damping_alone_is_found_without_friction():
    found = guess(coulomb_run(mu=1e-9, zeta=0.01, samples=4000), wrong(), "mu", "damping", "stiffness")
    assert found["damping"] == pytest.approx(2 * 0.01 * np.sqrt(STIFFNESS * PROTOTYPE_MASS), rel=0.02)
    assert 0 < found["mu"] < 1e-4


def test_what_is_held_fixed_is_taken_into_account():
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD, Coulomb(0.3))
    assert guess(coulomb_run(), start, "mu")["mu"] == pytest.approx(0.05, rel=0.01)
    held = Oscillator(PROTOTYPE_MASS, STIFFNESS, 9.0, LOAD, Coulomb(0.01))
    assert guess(coulomb_run(mu=0.01), held, "damping")["damping"] == pytest.approx(PROTOTYPE_DAMPING, rel=0.05)


def integrated(machine: Machine, x0: float, duration: float, rate: float) -> Trace:
    t = np.arange(round(duration * rate)) / rate
    x = slide(machine, x0, 0.0, t, rtol=1e-10).x
    return Trace(t, x + 1e-7 * x0 * np.random.default_rng(0).standard_normal(t.size))


def test_a_pendulum_of_large_amplitude():
    machine = Machine(1.0, 0.1, lambda x: 50 * np.sin(x), lambda speed: 0.5, 0.5)
    trace = integrated(machine, 1.4, 6.0, 1e3)
    start = Oscillator(1.0, 200.0, 0.0, 1.0, Coulomb(2.0), restoring=Pendulum())
    found = guess(trace, start, "mu", "damping", "stiffness")
    assert found["stiffness"] == pytest.approx(50, rel=0.01)
    assert found["mu"] == pytest.approx(0.5, rel=0.05)
    assert found["damping"] == pytest.approx(0.1, rel=0.2)


def test_drag_beside_dry_and_viscous_friction():
    machine = Machine(PROTOTYPE_MASS, 0.2, lambda x: STIFFNESS * x, lambda speed: 0.1, 0.1, drag=2.0)
    trace = integrated(machine, 4e-3, 1.5, 5e3)
    found = guess(trace, wrong(), "mu", "damping", "drag", "stiffness")
    assert found["mu"] == pytest.approx(0.1 / LOAD, rel=0.05)
    assert found["damping"] == pytest.approx(0.2, rel=0.1)
    assert found["drag"] == pytest.approx(2.0, rel=0.1)


def test_a_hardening_spring():
    k3 = 3e8
    machine = Machine(PROTOTYPE_MASS, 0.2, lambda x: STIFFNESS * x + k3 * x**3, lambda speed: 0.1, 0.1)
    trace = integrated(machine, 2e-3, 1.0, 5e3)
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, 0.0, LOAD, Coulomb(0.1), restoring=Cubic(k3))
    found = guess(trace, start, "mu", "damping", "stiffness")
    assert found["stiffness"] == pytest.approx(STIFFNESS, rel=0.03)
    assert found["mu"] == pytest.approx(0.1 / LOAD, rel=0.1)


def test_a_single_stroke_still_gives_a_start():
    found = guess(coulomb_run(0.5e-3), wrong(), "mu", "damping", "stiffness")
    assert all(np.isfinite(value) and value > 0 for value in found.values())
    assert found["stiffness"] == pytest.approx(STIFFNESS, rel=0.05)


def test_with_two_reversals_the_release_tells_the_equilibrium():
    """Use the release to find the equilibrium.

    The mean of two reversals is off by half of the loss of a stroke.
    With it, the guess of friction would be five times too small.
    """
    run = coulomb_run(1e-3)
    assert segment(np.asarray(run.t), np.asarray(run.x)).turning_points.size == 2
    found = guess(run, wrong(), "mu", "damping", "stiffness")
    assert found["mu"] == pytest.approx(0.05, rel=0.03)
    assert found["stiffness"] == pytest.approx(STIFFNESS, rel=1e-3)


@pytest.mark.parametrize("few", [1, 2, 3, 4])
def test_losses_that_are_not_negative_are_those_of_scipy(few: int):
    random = np.random.default_rng(few)
    for shift in (0.0, 2.0):
        columns, values = shift + random.standard_normal((9, few)), random.standard_normal(9)
        assert non_negative(columns, values) == pytest.approx(nnls(columns, values)[0], abs=1e-12)
