"""Energy routes against the truth of synthetic runs.

The tests cover the energy of a decay, half-cycles, regression of the energy, and the weak form.
"""

import functools
import json

import numpy as np
import pytest

import fricjax as fj
from fricjax.data import Trace
from fricjax.energy_loss.energy import energy_of
from fricjax.energy_loss.half_cycles import half_cycle_friction
from fricjax.energy_loss.regression import integral_friction
from fricjax.energy_loss.weak import weak_form
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb, Stribeck
from fricjax.oscillator.restoring import Cubic
from fricjax.rig import Measured
from tests.energy_loss.runs import LOAD, OFFSET, RIG, campaign, run
from tests.oracles import Machine, coulomb_viscous, slide
from tests.tiers import cases

STIFFNESS, MASS, FORCE = 2574.0, 0.41068, 0.05 * LOAD
DAMPING = 2 * 0.0027 * np.sqrt(STIFFNESS * MASS)


@functools.cache
def coulomb_runs():
    return campaign(Coulomb(0.05), 1.3e-3, 2e-3, 5)


@pytest.mark.parametrize("release", cases([0.0, 1e-3, 3e-3], [1e-3]))
def test_half_cycles_give_mu_whatever_the_release(release):
    runs = campaign(Coulomb(0.05), 0.25e-3, 2e-3, 36, rate=10e3, release_time_constant=release)
    found = half_cycle_friction(runs, RIG)
    assert found.mu.value == pytest.approx(0.05, rel=1e-5)
    assert abs(found.mean.value - FORCE) < 4 * found.mean.std
    assert found.mean.std < 1e-6 * FORCE
    assert 0.5 < found.chi2_reduced < 1.7
    assert found.force.size >= 50 and len(found.notes) >= 10


def test_the_viscous_loss_of_a_half_cycle_is_exact():
    t = np.arange(10_000) / 20e3
    exact = coulomb_viscous(t, 3e-3, frequency=20.0, zeta=0.05, dead_band=1e-4)
    rig = RIG.replace(mass=1.0, stiffness=(2 * np.pi * 20.0) ** 2, damping_ratio=0.05)
    noise = 1e-11 * np.random.default_rng(0).standard_normal(t.size)
    found = half_cycle_friction(Trace(t, exact.x + noise, 1e-11), rig)
    assert found.force == pytest.approx(1e-4 * (2 * np.pi * 20.0) ** 2, rel=2e-6)
    assert found.swing == pytest.approx(np.abs(np.diff(exact.points)), rel=1e-6)


def test_quadratic_drag_and_a_cubic_spring_are_taken_into_account():
    machine = Machine(1.0, 0.5, lambda x: 5000 * x + 2e8 * x**3, lambda speed: 0.981, 0.981, drag=0.4)
    t = np.arange(10_000) / 20e3
    moved = slide(machine, 3e-3, 0.0, t)
    rig = RIG.replace(mass=1.0, stiffness=5000.0, damping=0.5, drag=0.4, restoring=Cubic(2e8), normal_force=9.81)
    noise = 1e-10 * np.random.default_rng(0).standard_normal(t.size)
    found = half_cycle_friction(Trace(t, moved.x + noise, 1e-10), rig)
    assert found.mu.value == pytest.approx(0.1, rel=2e-3)


def test_uncertainties_of_the_rig_go_into_mu():
    rig = RIG.replace(stiffness=Measured(STIFFNESS, 2.574), normal_force=Measured(LOAD, 0.0483))
    found = half_cycle_friction(coulomb_runs()[0], rig)
    assert found.mu.std == pytest.approx(0.05 * np.hypot(1e-3, 5e-3), rel=1e-2)
    assert found.mean.std < 1e-5 * FORCE


def test_a_scale_of_the_displacement_stretches_mu():
    rig = RIG.replace(displacement_scale=Measured(1.0, 2e-3), time_scale=Measured(1.0, 1e-3))
    found = half_cycle_friction(coulomb_runs()[0], rig)
    assert found.mu.std == pytest.approx(0.05 * 2e-3, rel=1e-3)


@pytest.mark.slow
def test_the_losses_of_a_run_without_contact_stand_where_the_rig_is_uncertain():
    """Take losses from a run without contact, for a rig without damping.

    A load uncertainty of 0.5 % gives the same relative uncertainty of mu.
    """
    rig = RIG.replace(damping_ratio=None, normal_force=Measured(LOAD, 5e-3 * LOAD))
    found = half_cycle_friction(coulomb_runs()[0], rig, run(Coulomb(0.0), 2e-3, rate=2e3, duration=3.0))
    assert found.mu.value == pytest.approx(0.05, rel=1e-4)
    assert found.mu.std == pytest.approx(5e-3 * found.mu.value, rel=1e-2)


@pytest.mark.slow
def test_the_scatter_betrays_a_law_that_depends_on_velocity():
    found = half_cycle_friction(campaign(Stribeck(0.05, 0.065, 5e-3), 1.3e-3, 2e-3, 4), RIG)
    assert found.chi2_reduced > 10


def test_energy_falls_by_friction_work():
    found = energy_of(coulomb_runs()[-1], RIG)
    path = np.ptp(coulomb_viscous(np.zeros(1), 2e-3, frequency=12.6, zeta=0.0027, dead_band=FORCE / STIFFNESS).points)
    assert found.offset == pytest.approx(OFFSET, abs=3e-8)
    assert found.energy[0] == pytest.approx(STIFFNESS * (path / 2) ** 2 / 2, rel=0.3)
    lost = np.trapezoid(found.friction_power + found.viscous_power, found.t)
    assert found.energy[0] - found.energy[-1] == pytest.approx(lost, rel=2e-3)
    moving = found.viscous_power > 0.1 * found.viscous_power.max()
    speed = np.sqrt(found.viscous_power / DAMPING)
    deviation = (found.friction_power - FORCE * speed)[moving] / found.rate_std[moving]
    assert np.sqrt(np.mean(deviation**2)) == pytest.approx(1.0, abs=0.2)
    assert len(found.plot().axes) == 2


def test_regression_of_the_energy_finds_coulomb_and_nothing_else():
    found = integral_friction(coulomb_runs(), RIG)
    truth = {"coulomb": FORCE, "viscous": 0.0, "quadratic": 0.0}
    for name, true in truth.items():
        assert abs(found.values[name] - true) < 3.5 * found.std_errors[name], name
    assert found.values["coulomb"] == pytest.approx(FORCE, rel=2e-5)
    assert 0.6 < found.chi2_reduced < 1.5


@pytest.mark.slow
def test_regression_of_the_energy_finds_a_stribeck_law_and_a_viscous_part():
    law, rig = Stribeck(0.05, 0.065, 5e-3), RIG.replace(damping=DAMPING + 0.1)
    runs = campaign(law, 1.3e-3, 2e-3, 5, rig=rig)
    found = integral_friction(runs, RIG, v_stribeck=5e-3)
    truth = {"coulomb": FORCE, "stribeck": 0.015 * LOAD, "viscous": 0.1, "quadratic": 0.0}
    for name, true in truth.items():
        assert abs(found.values[name] - true) < 4 * found.std_errors[name], name
    assert found.units["viscous"] == "N s/m"


def test_the_weak_form_needs_no_start_values():
    found = weak_form(coulomb_runs(), RIG)
    frequency = np.sqrt(STIFFNESS / MASS) / (2 * np.pi)
    truth = {"natural_frequency": frequency, "damping_ratio": 0.0027, "mu": 0.05}
    truth |= {f"offset[{i}]": OFFSET for i in range(5)}
    assert list(found.values) == list(truth)
    for name, true in truth.items():
        assert abs(found.values[name] - true) < 4 * found.std_errors[name], name
    assert found.values["mu"] == pytest.approx(0.05, rel=1e-4)
    assert found.values["natural_frequency"] == pytest.approx(frequency, rel=1e-4)


def test_results_are_plain_data_and_tables():
    results = half_cycle_friction(coulomb_runs()[:2], RIG), weak_form(coulomb_runs()[0], RIG)
    for result in results:
        json.dumps(result.to_dict())
        assert "<table>" in result._repr_html_()
    assert "mean friction force" in results[0].summary()
    assert results[0].to_dataframe()["force"].tolist() == results[0].force.tolist()
    assert "natural_frequency" in results[1].summary()


@pytest.mark.parametrize("route", [energy_of, half_cycle_friction, integral_friction, weak_form])
def test_too_short_a_motion_is_refused(route):
    with pytest.raises(DataError, match=r"Half-cycles after the first reversal: 1\. At least 2"):
        route(run(Coulomb(0.05), 0.6e-3), RIG)


@pytest.mark.parametrize("route", [energy_of, half_cycle_friction, integral_friction])
def test_a_rig_without_damping_is_refused(route):
    with pytest.raises(UsageError, match="The rig has no damping"):
        route(coulomb_runs()[0], RIG.replace(damping_ratio=None))


def test_a_stribeck_velocity_must_be_positive():
    with pytest.raises(UsageError, match="v_stribeck must be a positive speed"):
        integral_friction(coulomb_runs()[0], RIG, v_stribeck=-1.0)


def test_a_rig_that_cannot_swing_as_the_record_does_is_remarked_on():
    files = fj.data.example_paths()
    rig = fj.Rig.from_toml(files.rig)
    assert not fj.half_cycle_friction(files.run, rig).notes
    heavy = rig.replace(mass=1e3 * 0.4107, stiffness=2574.0, damping=0.18)
    (note,) = fj.half_cycle_friction(files.run, heavy).notes
    assert "natural frequency of 0.3984 Hz, but the record oscillates at 12.6 Hz" in note and "a mass in g" in note
