"""Budgets of routes against closed forms and their combined errors."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.uncertainty import route_budget

pytestmark = pytest.mark.slow

PAIRS = [1.1e-3, 1.5e-3, 2.1e-3, 2.5e-3], [1.02e-4, -1e-4, -1.01e-4, 1e-4]
RIG = fj.Rig(mass=0.4, stiffness="2500 +/- 25", damping=0.0, normal_force="10 +/- 0.05")


def test_of_a_map_without_damping_mu_is_a_product():
    """Check the relative sensitivities of mu = k x_d/N.

    They are one and minus one.
    """
    budget = route_budget(fj.fit_triangle_map, RIG, *PAIRS)
    mu = budget.value
    assert budget.sensitivities["stiffness"] == pytest.approx(mu / 2500, rel=1e-3)
    assert budget.sensitivities["normal_force"] == pytest.approx(-mu / 10, rel=1e-3)
    alone = fj.fit_triangle_map(*PAIRS, RIG)
    assert budget.std == pytest.approx(alone.combined_std_errors["mu"], rel=5e-3)
    assert budget.inputs["scatter of the readings"].std == alone.std_errors["mu"]


def test_of_pairs_the_rig_counts_which_the_route_takes_for_exact():
    route = lambda x0, xf, rig: fj.fit_final_displacements(x0, xf, rig.oscillator(fj.friction.Coulomb(0.05)))
    budget, alone = route_budget(route, RIG, *PAIRS), route(*PAIRS, RIG)
    known = np.hypot(0.01, 0.005) * budget.value
    assert budget.std == pytest.approx(np.hypot(known, alone.std_errors["mu"]), rel=5e-3)


def test_of_an_energy_loss_the_scale_of_the_reading_counts():
    """Check that mu is proportional to the displacement scale.

    mu is a force over the load, and the forces m x'' and k x are proportional to the scale.
    """
    rig = fj.Rig(mass=0.4, stiffness=2500.0, damping=0.2, normal_force="10 +/- 0.1", displacement_scale="1 +/- 0.002")
    machine = rig.oscillator(fj.friction.Coulomb(0.05))
    run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    route = lambda run, rig: fj.fit_force_map(fj.friction_force_map(run, rig), fj.friction.Coulomb(0.05), ["mu"])
    budget = route_budget(route, rig, run)
    assert budget.value == pytest.approx(0.05, rel=2e-3)
    assert budget.sensitivities["displacement_scale"] == pytest.approx(budget.value, rel=0.01)
    assert budget.contributions["normal_force"] == pytest.approx(-0.01 * budget.value, rel=0.01)
    assert np.isclose(sum(budget.shares.values()), 1.0)
    assert "displacement_scale" in budget.summary() and budget.plot().get_axes()


def test_what_a_route_does_not_give_is_refused():
    with pytest.raises(UsageError, match=r"gives no 'nu'\. Did you mean 'mu'\? It gives mu\."):
        route_budget(fj.fit_triangle_map, RIG, *PAIRS, name="nu")
