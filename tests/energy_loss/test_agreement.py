"""All routes agree under the right law and disagree under another."""

import numpy as np
import pytest

import fricjax as fj
from fricjax import compare_routes
from fricjax.energy_loss.agreement import weighted_mean
from fricjax.errors import UsageError
from tests.pairs.campaigns import DAMPING, LOAD, MASS, MU, STIFFNESS

RIG = fj.Rig(mass=MASS, stiffness=fj.Measured(STIFFNESS, 26.0), damping=DAMPING, normal_force=LOAD)
STARTS = np.linspace(0.9e-3, 2e-3, 6)


def runs(law) -> list[fj.Record]:
    how = {"rate": 10e3, "duration": 0.4, "noise": 1e-9, "offset": 3e-6}
    return [fj.synthetic_run(RIG.oscillator(law), x0, seed=i, **how) for i, x0 in enumerate(STARTS)]


def test_under_coulomb_friction_all_routes_agree():
    found = compare_routes(runs(fj.friction.Coulomb(MU)), RIG)
    assert len(found.routes) == 5 and not found.failures
    for route in found.routes:
        assert route.mu.value == pytest.approx(MU, rel=2e-5)
    assert found.agree and "one coefficient of Coulomb friction describes the runs" in found.summary()
    assert found.spread < 2e-5
    assert "<table>" in found._repr_html_() and found.to_dict()["agree"]


@pytest.mark.slow
def test_a_stribeck_law_drives_them_apart():
    found = compare_routes(runs(fj.friction.Stribeck(MU, 0.065, v_stribeck=5e-3)), RIG)
    assert not found.agree and found.spread > found.tolerance
    assert "ook at the force map" in found.conclusion


def test_routes_that_find_nothing_are_named():
    one = [fj.synthetic_run(RIG.oscillator(fj.friction.Coulomb(MU)), 0.4e-3, rate=10e3, duration=0.3, noise=1e-9)]
    with pytest.raises(UsageError, match="No route gave a number"):
        compare_routes(one, RIG)
    with pytest.raises(UsageError, match="the list is empty"):
        compare_routes([], RIG)


def test_the_most_precise_route_speaks_for_all():
    """Report the most precise route, since all routes use the same samples."""
    found = compare_routes(runs(fj.friction.Coulomb(MU)), RIG)
    best = min(found.routes, key=lambda route: route.mu.std)
    assert found.mu.value == best.mu.value and found.mu.std >= best.mu.std
    assert "most precise" in found.summary()


def test_the_weighted_mean():
    mean, std, chi2 = weighted_mean(np.array([1.0, 3.0]), np.array([1.0, 1.0]))
    assert (mean, chi2) == (2.0, 2.0)
    assert std == pytest.approx(1.0)
