"""Profiles against fits with a fixed parameter, and verdicts on known curves."""

import dataclasses

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.uncertainty.profiles import conclude
from tests.machines import coulomb_run

FREE = ("mu", "damping", "stiffness")


@pytest.fixture(scope="module")
def fit():
    machine = fj.Oscillator(0.41068, 2574.0, 0.1756, 9.66, fj.friction.Coulomb(0.05))
    return fj.fit(coulomb_run(), machine, FREE)


@pytest.mark.parametrize("name", FREE)
def test_a_parabola_has_the_interval_of_its_standard_error(fit, name):
    profile = fj.uncertainty.profile(fit, name)
    assert profile.conclusion == "bounded"
    low, high = profile.interval
    assert (high - low) / 2 == pytest.approx(1.959964 * fit.std_errors[name], rel=1e-3)
    assert (high + low) / 2 == pytest.approx(fit.values[name], abs=2e-3 * fit.std_errors[name])
    assert profile.excess == pytest.approx(((profile.at - fit.values[name]) / fit.std_errors[name]) ** 2, abs=1e-2)


def test_the_profile_is_that_of_fits_without_the_parameter(fit):
    """Compare chi^2 and the other parameters with fits at fixed mu."""
    profile = fj.uncertainty.profile(fit, "mu", points=3)
    machine = fit.oscillator
    for at, excess, damping in zip(profile.at, profile.excess, profile.others["damping"], strict=True):
        law = fj.friction.Coulomb(float(at))
        fixed = fj.fit(coulomb_run(), dataclasses.replace(machine, friction=law), ("damping", "stiffness"))
        assert fixed.chi2 - fit.chi2 == pytest.approx(excess, abs=2e-3)
        assert fixed.values["damping"] == pytest.approx(damping, abs=1e-3 * fit.std_errors["damping"])


@pytest.mark.slow
def test_a_ridge_is_one_sided_where_a_standard_error_says_bounded():
    """Profile mu_s under 20 um of noise.

    A higher and narrower peak of static friction then describes the record equally well.
    """
    machine = fj.Oscillator(0.41068, 2574.0, 0.1756, 9.66, fj.friction.Stribeck(0.05, mu_s=0.065, v_stribeck=5e-3))
    run = fj.synthetic_run(machine, 2e-3, rate=20e3, duration=0.4, noise=2e-5, seed=1)
    fit = fj.fit(run, machine, ("mu", "mu_s", "v_stribeck"))
    profile = fj.uncertainty.profile(fit, "mu_s")
    assert profile.conclusion == "one-sided"
    assert fit.values["mu_s"] + 1.96 * fit.std_errors["mu_s"] < 0.08 < profile.at[-1]
    # A fit with a bound must give the same chi^2.
    held = fj.fit(run, machine, ("mu", "mu_s", "v_stribeck"), bounds={"mu_s": (0.07, 0.0701)})
    assert held.values["mu_s"] == pytest.approx(0.07)
    assert held.chi2 - fit.chi2 == pytest.approx(float(np.interp(0.07, profile.at, profile.excess)), abs=0.02)
    assert held.chi2 - fit.chi2 < 3.84


@pytest.mark.parametrize(
    ("shape", "verdict", "ends"),
    [
        (lambda x: x**2, "bounded", (-1.96, 1.96)),
        (lambda x: np.where(x < 0, x**2, x**2 / (1 + x**2)), "one-sided", (-1.96, np.inf)),
        (lambda x: 0.5 * x**2 / (1 + x**2), "flat", (-np.inf, np.inf)),
        (lambda x: 6 * (1 - np.cos(2 * x)) + x**2 / 9, "multimodal", (-3.605, 3.605)),
    ],
    ids=["bounded", "one-sided", "flat", "multimodal"],
)
def test_the_verdict_on_a_curve(shape, verdict, ends):
    x = np.linspace(-6, 6, 481)
    found = conclude(x, shape(x))
    assert found[1] == verdict
    assert found[0] == pytest.approx(ends, abs=0.02)


def test_what_cannot_be_profiled_is_refused(fit, tmp_path):
    with pytest.raises(UsageError, match=r"'nu' is not free in this fit\. Did you mean 'mu'\? Free are mu, damping"):
        fj.uncertainty.profile(fit, "nu")
    loaded = fj.load_fit(fit.save(tmp_path / "fit.json"))
    with pytest.raises(UsageError, match="This fit was read from a file, which does not hold its settings"):
        fj.uncertainty.profile(loaded, "mu")
