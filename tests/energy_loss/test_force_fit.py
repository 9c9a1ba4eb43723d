"""Laws fitted to force maps, against the truth and against SciPy."""

import dataclasses
import functools
import json

import numpy as np
import pytest
from scipy.optimize import curve_fit

from fricjax.energy_loss.force_fit import fit_force_map
from fricjax.energy_loss.force_map import ForceMap, friction_force_map
from fricjax.errors import UsageError
from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Stribeck, Tanh
from fricjax.rig import Measured
from tests.energy_loss.runs import LOAD, RIG, campaign

TRUTH = {"mu": 0.05, "mu_s": 0.065, "v_stribeck": 5e-3}


def stribeck(v, mu, mu_s, v_stribeck):
    return np.sign(v) * LOAD * (mu + (mu_s - mu) * np.exp(-((v / v_stribeck) ** 2)))


@functools.cache
def made():
    """A map with known scatter."""
    speed = np.geomspace(5e-4, 0.1, 40)
    v = np.concatenate([speed, -speed])
    std = 2e-3 * (1 + 1e-3 / np.abs(v))
    force = stribeck(v, **TRUTH) + std * np.random.default_rng(1).standard_normal(v.size)
    ones = np.ones(v.size, int)
    sides = {"direction": np.sign(v).astype(int), "branch": ones, "count": 10 * ones}
    rest = {"damping": 0.0, "drag": 0.0, "offsets": (), "quantity": "m", "notes": ()}
    return ForceMap(v, force, std, edges=speed, mean=Measured(0.5, 1e-3), normal_force=LOAD, **sides, **rest)


def test_it_is_the_weighted_least_squares_of_scipy():
    found = fit_force_map(made(), Stribeck(0.04, 0.09, 2e-3))
    values, covariance = curve_fit(
        stribeck, made().velocity, made().force, list(TRUTH.values()), made().std, absolute_sigma=True
    )
    assert found.converged
    std = np.sqrt(np.diag(covariance))
    assert np.array(list(found.values.values())) == pytest.approx(values, abs=1e-2 * std.min())
    assert found.covariance == pytest.approx(covariance, rel=1e-3)
    assert list(found.values) == list(TRUTH)
    assert found.dof == 77
    assert found.chi2 == pytest.approx(np.sum((found.residuals / made().std) ** 2))
    assert 0.6 < found.chi2_reduced < 1.4


@pytest.mark.slow
def test_a_campaign_gives_the_stribeck_law():
    found = fit_force_map(
        friction_force_map(campaign(Stribeck(**TRUTH), 1.3e-3, 2e-3, 5), RIG), Stribeck(0.04, 0.08, 2e-3)
    )
    for name, true in TRUTH.items():
        assert abs(found.values[name] - true) < 3.5 * found.std_errors[name], name
        assert found.values[name] == pytest.approx(true, rel=2e-3)
    assert found.chi2_reduced < 1.5
    load = np.asarray(1.0)
    assert float(found.friction.dynamic_force(load)) == found.values["mu"]  # pyright: ignore[reportArgumentType]


def test_a_wrong_law_shows_in_chi2():
    assert fit_force_map(made(), Coulomb(0.05), ["mu"]).chi2_reduced > 30


def test_what_the_map_does_not_tell_is_infinite():
    found = fit_force_map(made(), Tanh(0.05, 1e-6))
    assert not found.converged
    assert np.isinf(found.std_errors["v_s"])


def test_sums_of_laws_take_their_names():
    found = fit_force_map(
        made(), Stribeck(0.05, 0.07, 4e-3) + QuadraticDrag(0.0), ["mu", "mu_s", "v_stribeck", "quadratic_drag"]
    )
    assert abs(found.values["quadratic_drag"]) < 4 * found.std_errors["quadratic_drag"]
    assert found.units["quadratic_drag"] == "N s^2/m^2"
    assert "Stribeck + QuadraticDrag" in found.summary()


def test_the_report_is_plain():
    found = fit_force_map(made(), Stribeck(0.05, 0.065, 5e-3), ["mu"])
    json.dumps(found.to_dict())
    assert "<table>" in found._repr_html_()


@pytest.mark.parametrize(
    ("law", "free", "says"),
    [
        (LuGre(0.05), None, "LuGre friction has internal states"),
        (Coulomb(0.05), ["mus"], "no coefficient 'mus'"),
        (Coulomb(0.05), ["normal_force"], "no coefficient 'normal_force'"),
        (Coulomb(0.05), [], "0 coefficients cannot be fitted"),
        ("coulomb", None, "friction must be a law"),
    ],
)
def test_wrong_arguments_get_a_sentence(law, free, says):
    with pytest.raises(UsageError, match=says):
        fit_force_map(made(), law, free)


def test_a_small_map_is_refused():
    cut = {name: getattr(made(), name)[:2] for name in ("velocity", "force", "std", "count", "direction", "branch")}
    with pytest.raises(UsageError, match="3 coefficients cannot be fitted to a map with 2 entries"):
        fit_force_map(dataclasses.replace(made(), **cut), Stribeck(0.05, 0.07, 1e-3))
