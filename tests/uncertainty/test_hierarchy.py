"""Posterior over runs against its closed form and ranks of drawn truths."""

import dataclasses
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

import fricjax as fj
from fricjax.errors import UsageError

sys.path.insert(0, str(Path(__file__).parents[2] / "experiments" / "uncertainty"))
calibration = importlib.import_module("calibration")

VALUES = 0.02 + 2e-4 * np.array([-1.3, -0.4, 0.1, 0.3, 0.6, 1.4])
ERRORS = np.full(6, 1e-7)


@pytest.fixture(scope="module")
def found():
    return fj.uncertainty.hierarchical((VALUES, ERRORS), draws=1500)


@pytest.mark.slow
def test_the_mean_is_distributed_as_student_says(found):
    """Compare with Student's t with n - 2 degrees of freedom.

    This holds for flat priors of mean and scatter (Gelman et al., 3.2, for that prior).
    """
    n = VALUES.size
    scale = np.sqrt(np.sum((VALUES - VALUES.mean()) ** 2) / (n * (n - 2)))
    expected = VALUES.mean() + scale * student(n - 2).ppf([0.1, 0.5, 0.9])
    assert np.quantile(found.mean, [0.1, 0.5, 0.9]) == pytest.approx(expected, abs=0.15 * scale)
    assert found.divergences == 0 and max(found.r_hat.values()) < 1.02


@pytest.mark.slow
def test_runs_that_are_known_stay_where_they_are(found):
    assert found.runs.mean(axis=(0, 1)) == pytest.approx(VALUES, abs=1e-8)
    assert found.runs.std(axis=(0, 1)) == pytest.approx(ERRORS, rel=0.1)
    assert set(found.to_datatree()["posterior"].data_vars) == {"mu", "mu_scatter", "mu_of_run"}
    assert "mean of mu" in found.summary() and found.plot().get_axes()[0].get_ylabel() == "mu [1]"


@pytest.fixture(scope="module")
def batch():
    """Four runs of a rig with a load uncertainty of 1 %."""
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    runs = [fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in range(4)]
    rig = fj.Rig(mass=0.4, stiffness=2500.0, normal_force="10 +/- 0.1", damping=0.2)
    return fj.fit_batch(runs, rig.oscillator(fj.friction.Coulomb(0.05)), ["mu", "damping", "stiffness"], rig=rig)


@pytest.mark.slow
def test_no_run_takes_the_error_of_the_rig_away(batch):
    """Keep the load uncertainty of 1 % in the mean.

    The mean has an uncertainty of 1 % even if the runs scatter little.
    """
    found = fj.uncertainty.hierarchical(batch, mean=fj.Measured(0.05, 0.1), scatter=1e-6)
    assert found.mean.std() == pytest.approx(0.01 * 0.05, rel=0.1)
    assert list(found.inputs) == ["normal_force"]


@pytest.mark.slow
def test_an_error_of_the_rig_that_runs_show_is_taken_out_of_the_mean(batch):
    """Estimate an error of the rig that affects runs differently.

    Mean and error are then intercept and slope of a line.
    """
    adds, error = 5e-4 * np.array([0.5, 1.0, 1.5, 2.0]), 1.2
    shown = dataclasses.replace(
        batch,
        values=batch.values | {"mu": 0.05 + error * adds},
        std_errors=batch.std_errors | {"mu": np.full(4, 1e-8)},
        contributions=batch.contributions | {"mu": {"normal_force": adds}},
    )
    found = fj.uncertainty.hierarchical(shown, mean=fj.Measured(0.05, 0.1), scatter=1e-7)
    assert found.mean.mean() == pytest.approx(0.05, abs=2e-6)
    assert found.inputs["normal_force"].mean() == pytest.approx(error, abs=5e-3)


@pytest.mark.slow
def test_ranks_of_truths_are_uniform():
    """Run experiments/uncertainty/calibration.py briefly, with numbers for records."""
    rng = np.random.default_rng(3)
    truths = calibration.truths_of(12, rng)
    values = truths[:, :1] + truths[:, 1:] * rng.standard_normal((12, 6))
    found = calibration.ranks(values, np.full((12, 6), 1e-7), truths, draws=100, thinned=19)
    for each in found.T:
        assert calibration.chi_square(each, bins=4, thinned=19)[1] > 1e-3


@pytest.mark.parametrize(
    ("runs", "settings", "sentence"),
    [
        ((VALUES[:2], ERRORS[:2]), {}, "needs at least three fitted runs, got 2"),
        ((VALUES, -ERRORS), {}, "positive standard errors"),
        ((VALUES, ERRORS), {"scatter": 0.0}, "needs a positive scale, got 0"),
        ((VALUES, ERRORS), {"chains": 1}, "two chains at least"),
    ],
)
def test_what_is_refused(runs, settings, sentence):
    with pytest.raises(UsageError, match=sentence):
        fj.uncertainty.hierarchical(runs, **settings)
