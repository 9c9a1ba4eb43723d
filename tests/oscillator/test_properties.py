"""Symmetries and balances of every machine."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fricjax.friction import Coulomb, Stribeck
from fricjax.oscillator import Exact, Hybrid, Oscillator, energy, simulate
from tests.tiers import cases

TS = np.linspace(0, 0.4, 201)
FINE = np.linspace(0, 0.4, 20_001)
ENGINES = {"exact": Exact(32), "hybrid": Hybrid(max_half_cycles=32)}


def run(name: str, p: Any, x0, v0, ts: np.ndarray = TS):
    """Simulate with `p` = mass, stiffness, damping, load, mu, mu_s/mu."""
    law = Coulomb(p[4], p[4] * p[5]) if name == "exact" else Stribeck(p[4], p[4] * p[5], 0.02)
    machine = Oscillator(p[0], p[1], p[2], p[3], law)
    return simulate(machine, x0, ts, v0=v0, engine=ENGINES[name])


FAST = {name: jax.jit(lambda p, x0, v0, name=name: run(name, p, x0, v0)) for name in ENGINES}

machines = st.builds(
    lambda *p: np.array(p),
    st.floats(0.3, 2),
    st.floats(1e3, 5e3),
    st.floats(0, 5),
    st.floats(1, 10),
    st.floats(0.02, 0.2),
    st.floats(1, 2),
)
displacements = st.floats(-3e-3, 3e-3)
velocities = st.one_of(st.just(0.0), st.floats(0.01, 0.2), st.floats(-0.2, -0.01))


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
@given(p=machines, x0=displacements, v0=velocities, factor=st.sampled_from([0.125, 4.0, 1024.0]))
def test_a_common_factor_of_all_forces_changes_nothing(name, p, x0, v0, factor):
    scaled = p * np.array([factor, factor, factor, factor, 1, 1])
    a, b = FAST[name](p, x0, v0), FAST[name](scaled, x0, v0)
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=1e-14)
    np.testing.assert_allclose(a.friction_force * factor, b.friction_force, rtol=1e-9, atol=1e-9 * factor)


@pytest.mark.parametrize("name", cases(ENGINES, ["exact"]))
@given(p=machines, x0=displacements, v0=velocities)
def test_the_mirrored_start_gives_the_mirrored_motion(name, p, x0, v0):
    a, b = FAST[name](p, x0, v0), FAST[name](p, -x0, -v0)
    np.testing.assert_array_equal(a.x, -b.x)
    np.testing.assert_array_equal(a.v, -b.v)
    np.testing.assert_array_equal(a.friction_force, -b.friction_force)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
@given(p=machines, x0=displacements, v0=velocities, index=st.integers(1, 60))
def test_a_motion_continued_from_one_of_its_samples_is_the_same_motion(name, p, x0, v0, index):
    whole = FAST[name](p, x0, v0)
    if whole.at_rest[index] or abs(whole.v[index]) < 1e-3:
        return
    rest = FAST[name](p, whole.x[index], whole.v[index])
    tolerance = {"exact": 1e-12, "hybrid": 1e-9}[name]
    np.testing.assert_allclose(rest.x[:-index], whole.x[index:], rtol=0, atol=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
@given(p=machines, fraction=st.floats(-0.999, 0.999))
def test_a_start_inside_the_static_band_stays(name, p, fraction):
    x0 = fraction * p[5] * p[4] * p[3] / p[1]
    motion = FAST[name](p, x0, 0.0)
    np.testing.assert_allclose(motion.x, x0, rtol=1e-13, atol=1e-18)
    assert np.all(motion.v == 0) and np.all(motion.at_rest)
    assert motion.t_stop == 0 and motion.n_half_cycles == 0
    np.testing.assert_allclose(motion.friction_force, -p[1] * x0, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
@given(p=machines, x0=displacements, v0=velocities)
def test_energy_falls_steadily_and_rest_is_final(name, p, x0, v0):
    motion = FAST[name](p, x0, v0)
    stored = p[0] * motion.v**2 / 2 + p[1] * motion.x**2 / 2
    assert np.all(np.diff(stored) <= 1e-9 * stored[0])
    np.testing.assert_array_equal(motion.at_rest, np.asarray(motion.t_stop) <= TS)
    assert np.all(motion.v[motion.at_rest] == 0)
    assert np.all(np.abs(motion.friction_force) <= p[3] * p[4] * p[5] * (1 + 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("v0", [0.0, 0.1])
def test_losses_balance_the_energy(name: str, v0: float):
    p: Any = np.array([0.41, 2574.0, 0.3, 9.66, 0.03, 1.2])
    motion = run(name, p, 2e-3, v0, FINE)
    machine = Oscillator(p[0], p[1], p[2], p[3], Coulomb(p[4], p[4] * p[5]))
    budget: Any = energy(machine, motion)
    lost = np.concatenate([[0], np.cumsum(np.diff(FINE) * (budget.loss_power[1:] + budget.loss_power[:-1]) / 2)])
    np.testing.assert_allclose(budget.total[0] - budget.total, lost, rtol=0, atol=3e-6 * float(budget.total[0]))
    assert budget.total[0] == pytest.approx(p[0] * v0**2 / 2 + p[1] * 2e-3**2 / 2)


def test_coulomb_friction_takes_its_force_times_the_path():
    p: Any = np.array([0.41, 2574.0, 0.3, 9.66, 0.03, 1.2])
    motion = run("exact", p, 2e-3, 0.0, FINE)
    path = float(np.abs(np.diff(motion.turning_points[: int(motion.n_half_cycles) + 1])).sum())
    viscous = float(np.sum(np.diff(FINE) * p[2] * (motion.v[1:] ** 2 + motion.v[:-1] ** 2) / 2))
    released = p[1] * (2e-3**2 - float(motion.x[-1]) ** 2) / 2
    assert released == pytest.approx(p[3] * p[4] * path + viscous, rel=1e-6)


def test_powers_are_what_they_are_called():
    p: Any = np.array([0.41, 2574.0, 0.3, 9.66, 0.03, 1.2])
    motion = run("exact", p, 2e-3, 0.0)
    budget = energy(Oscillator(p[0], p[1], p[2], p[3], Coulomb(p[4]), drag=0.7), motion)
    np.testing.assert_allclose(budget.damping_power, 0.3 * motion.v**2)
    np.testing.assert_allclose(budget.drag_power, 0.7 * np.abs(motion.v) ** 3)
    sliding = np.asarray(motion.v != 0)
    friction = 9.66 * 0.03 * np.abs(motion.v)
    np.testing.assert_allclose(budget.friction_power[sliding], friction[sliding])
    assert jnp.all(budget.friction_power[~sliding] == 0)
