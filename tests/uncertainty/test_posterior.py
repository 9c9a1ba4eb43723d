"""Posterior draws against the covariance, a prior and a profile."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError

pytest.importorskip("numpyro", reason="numpyro is not installed (extra bayes)")

FREE = ("mu", "damping", "stiffness")
MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))


def run(noise=1e-9):
    return fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=noise, seed=0)


@pytest.fixture(scope="module")
def fit():
    return fj.fit(run(), MACHINE, FREE)


@pytest.fixture(scope="module")
def posterior(fit):
    return fj.uncertainty.posterior(fit, 500)


@pytest.mark.slow
def test_a_normal_posterior_has_the_covariance_of_the_fit(fit, posterior):
    assert posterior.converged and posterior.divergences == 0
    assert min(posterior.effective.values()) >= 400
    for name in fit.names:
        assert posterior.std[name] == pytest.approx(fit.std_errors[name], rel=0.08)
    flat = posterior.sample.reshape(-1, len(fit.names))
    assert np.corrcoef(flat, rowvar=False) == pytest.approx(fit.correlation, abs=0.08)
    means = (flat.mean(axis=0) - [fit.values[name] for name in fit.names]) / [fit.std_errors[n] for n in fit.names]
    assert np.abs(means).max() < 0.15


@pytest.mark.slow
def test_intervals_are_those_of_the_profile(fit, posterior):
    """Compare with the profile interval, which is 1.96 standard errors here.

    The interval of 2000 draws has an error of some three percent of its width.
    """
    profile = fj.uncertainty.profile(fit, "mu")
    width = profile.interval[1] - profile.interval[0]
    assert posterior.intervals()["mu"] == pytest.approx(profile.interval, abs=0.05 * width)


@pytest.mark.slow
def test_a_prior_is_part_of_the_posterior():
    """Compare with the closed form for a normal likelihood and prior.

    Record and prior have equal weights.
    """
    alone = fj.fit(run(1e-6), MACHINE, FREE)
    std = alone.std_errors["damping"]
    value = alone.values["damping"] + 2 * std
    both = fj.fit(run(1e-6), MACHINE, FREE, priors={"damping": (value, std)})
    drawn = fj.uncertainty.posterior(both, 200, warmup=150)
    assert drawn.std["damping"] == pytest.approx(std / np.sqrt(2), rel=0.1)
    mean = drawn.sample[:, :, FREE.index("damping")].mean()
    assert mean == pytest.approx(alone.values["damping"] + std, abs=0.15 * std)


@pytest.mark.slow
def test_a_bound_cuts_the_posterior(fit):
    low = fit.values["mu"] - 0.5 * fit.std_errors["mu"]
    bounded = fj.uncertainty.posterior(fj.fit(run(), MACHINE, FREE, bounds={"mu": (low, None)}), 200, warmup=150)
    assert bounded.sample[:, :, 0].min() >= low
    # The mean of a normal distribution rises by 0.51 standard deviations if it is cut at half of one below the mean.
    shift = (bounded.sample[:, :, 0].mean() - fit.values["mu"]) / fit.std_errors["mu"]
    assert shift == pytest.approx(0.509, abs=0.2)


@pytest.mark.slow
def test_arviz_takes_the_draws(posterior):
    tree = posterior.to_datatree()
    assert tree["posterior"]["mu"].shape == (4, 500)


@pytest.mark.slow
def test_what_has_no_posterior_is_refused(fit):
    with pytest.raises(UsageError, match="A robust loss is no likelihood"):
        fj.uncertainty.posterior(fj.fit(run(), MACHINE, FREE, loss="huber"))
    with pytest.raises(UsageError, match="Take 100 draws and two chains at least"):
        fj.uncertainty.posterior(fit, 10)
