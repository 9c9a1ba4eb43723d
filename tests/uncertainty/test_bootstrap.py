"""Scatter of resampled fits against standard errors, for white and coloured noise."""

import dataclasses

import equinox as eqx
import jax
import numpy as np
import pytest
from scipy.signal import lfilter

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.fitting.problem import displaced, with_windows
from tests.machines import coulomb_run
from tests.tiers import cases

FREE = ("mu", "damping", "stiffness")
MACHINE = fj.Oscillator(0.41068, 2574.0, 0.1756, 9.66, fj.friction.Coulomb(0.05))
DRAWS = 256
# Five standard errors of a standard deviation from this number of draws.
NEAR = 5 / np.sqrt(2 * DRAWS)


@pytest.fixture(scope="module")
def white():
    return fj.fit(coulomb_run(), MACHINE, FREE)


@pytest.fixture(scope="module")
def coloured():
    """Fit of a long record with coloured noise and many blocks."""
    run = fj.synthetic_run(MACHINE, 2e-3, rate=2e4, duration=0.4, noise=0.0, seed=0)
    shocks = 2e-8 * np.random.default_rng(5).normal(size=len(run))
    noise = np.asarray(lfilter([1.0], [1.0, -0.9], shocks))
    return fj.fit((run.t, run.x + noise), MACHINE, FREE)


@pytest.mark.parametrize("noise", cases(["blocks", "model"], ["blocks"]))
def test_the_scatter_is_the_standard_error(white, noise):
    sample = fj.uncertainty.bootstrap(white, DRAWS, noise=noise)
    assert sample.failed == 0
    for name in FREE:
        assert sample.std[name] == pytest.approx(white.std_errors[name], rel=NEAR)
        # The standard error of the mean is smaller by the square root of the number of draws.
        assert abs(sample.bias[name]) < 5 * white.std_errors[name] / np.sqrt(DRAWS)
    assert sample.covariance.shape == (len(white.names),) * 2


def test_records_of_white_noise_are_fitted_by_least_squares_as_the_fit_was(white):
    """Fit the draws by least squares if the fit found white noise.

    About one draw in a hundred looks coloured by chance.
    """
    sample = fj.uncertainty.bootstrap(white, 40)
    by_squares = fj.uncertainty.bootstrap(fj.fit(coulomb_run(), MACHINE, FREE, noise="white"), 40)
    assert white.noises[0].white and np.array_equal(sample.sample, by_squares.sample)


@pytest.mark.slow
def test_noise_that_remembers_scatters_as_the_fit_says_and_not_as_white_noise(coloured):
    sample = fj.uncertainty.bootstrap(coloured, 64)
    assert sample.block[0] > 20
    # Simulated records of this noise scatter by 0.92 of these standard errors and by 4.5 of those for white noise.
    # Blocks of this length lose about a tenth of the scatter, and 64 draws determine it to nine percent.
    for name in FREE:
        assert 0.6 < sample.std[name] / coloured.std_errors[name] < 1.2
        assert sample.std[name] > 2.5 * coloured.white_std_errors[name]


def test_the_same_seed_gives_the_same_numbers(white):
    first, second, other = (fj.uncertainty.bootstrap(white, 40, seed=seed).sample for seed in (1, 1, 2))
    assert np.array_equal(first, second) and not np.array_equal(first, other)


@pytest.mark.slow
def test_runs_of_a_joint_fit_are_resampled_together():
    runs = [
        fj.synthetic_run(MACHINE, x0, rate=2e3, duration=0.5, noise=1e-8, seed=i) for i, x0 in enumerate((1e-3, 2e-3))
    ]
    fit = fj.fit(runs, MACHINE, FREE)
    sample = fj.uncertainty.bootstrap(fit, 40)
    assert sample.std["mu"] == pytest.approx(fit.std_errors["mu"], rel=5 / np.sqrt(80))
    assert sample.sample.shape == (40, len(fit.names))


def test_what_cannot_be_resampled_is_refused(white):
    with pytest.raises(UsageError, match=r"There is no noise 'block'\. Did you mean 'blocks'\?"):
        fj.uncertainty.bootstrap(white, noise="block")
    with pytest.raises(UsageError, match="10 draws are too few for an interval of 95 %"):
        fj.uncertainty.bootstrap(white, 10)


def test_noise_that_remembers_has_no_model_to_draw_from(coloured):
    with pytest.raises(UsageError, match="is correlated and has no simple model"):
        fj.uncertainty.bootstrap(coloured, noise="model")


def test_the_problem_of_a_resampled_record_is_that_of_a_record_measured_so(white):
    """Compare a displaced problem with one built from the changed record.

    The displaced problem reuses everything that depends only on times and weights.
    """
    problem = white.problem
    (window,) = problem.windows
    x = np.asarray(window.trace.x) + 1e-9 * np.random.default_rng(3).normal(size=window.trace.n)
    trace = eqx.tree_at(lambda trace: trace.x, window.trace, x)
    anew = with_windows(problem, (dataclasses.replace(window, trace=trace),))
    shared = displaced(problem)([x])
    for ours, theirs in ((shared.residual, anew.residual), (shared.condensed, anew.condensed)):
        for left, right in zip(jax.tree.leaves(ours.runs), jax.tree.leaves(theirs.runs), strict=True):
            assert np.array_equal(left, right)
    assert np.array_equal(shared.stage_weights[0].moving, anew.stage_weights[0].moving)
