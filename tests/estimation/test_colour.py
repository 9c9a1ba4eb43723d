"""Fitted autoregressive noise against known processes, and least squares weighted by it."""

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_lyapunov, toeplitz
from scipy.signal import lfilter

from fricjax.estimation.autoregression import autoregression, innovations
from fricjax.estimation.colour import Series, colour_of, whitened

START = np.array([0])


def series(noise: np.ndarray) -> Series:
    t = np.arange(noise.size) * 1e-3
    slopes = np.column_stack([np.cos(20 * t), t])
    return Series(t, noise, slopes, np.ones(noise.size), START, np.zeros((noise.size, 0)))


def test_white_noise_has_no_colour():
    random = np.random.default_rng(0)
    assert sum(colour_of(series(random.standard_normal(600)), 1.0, True) is not None for _ in range(100)) <= 5


@pytest.mark.parametrize("coefficients", [[0.9], [1.0], [1.6, -0.9]])
def test_the_coefficients_of_a_process_are_found(coefficients):
    drive = np.random.default_rng(1).standard_normal(20_000)
    found, _ = autoregression(np.asarray(lfilter([1.0], [1.0, *-np.array(coefficients)], drive)), START)
    assert found[: len(coefficients)] == pytest.approx(coefficients, abs=0.03)


def test_coloured_residuals_come_out_white():
    drive = np.random.default_rng(2).standard_normal(4000)
    run = series(np.asarray(lfilter([1.0], [1.0, -0.95], drive)))
    colour = colour_of(run, 1.0, False)
    assert colour is not None and not colour.drift and not colour.lines
    residual, slopes = whitened(run, colour)
    assert slopes.shape == (residual.size, 2)
    assert np.std(residual) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(residual[1:] * residual[:-1])) < 4 / np.sqrt(residual.size)


@pytest.mark.parametrize("coefficients", [[0.9], [1.6, -0.9], [1.2, -0.5, 0.2]])
def test_innovations_of_the_whole_run_are_those_of_the_stationary_covariance(coefficients):
    """Compare whitened rows with the covariance from the state space.

    Whitening must turn that covariance into the identity, also for two separate stretches.
    """
    order, rows = len(coefficients), 40
    carried = np.vstack([coefficients, np.eye(order)[:-1]]).astype(float)
    kicked = np.outer(np.eye(order)[0], np.eye(order)[0])
    state = solve_discrete_lyapunov(carried, kicked)
    lags = []
    for _ in range(rows):
        lags.append(state[0, 0])
        state = carried @ state
    covariance = toeplitz(lags)
    white = innovations(np.eye(rows), START, np.array(coefficients))
    assert white @ covariance @ white.T == pytest.approx(np.eye(rows), abs=1e-9)
    halves = innovations(np.eye(rows), np.array([0, rows // 2]), np.array(coefficients))
    apart = block_diag(covariance[: rows // 2, : rows // 2], covariance[rows // 2 :, rows // 2 :])
    assert halves @ apart @ halves.T == pytest.approx(np.eye(rows), abs=1e-9)


def test_a_mode_that_the_release_excites_starts_larger_than_it_is_kept_up():
    """Check that the large first rows do not raise the estimated noise."""
    random, process = np.random.default_rng(7), [1.8, -0.95]
    kept_up = np.asarray(lfilter([1.0], [1.0, *-np.array(process)], random.standard_normal(1500)))[500:]
    excited = 300 * 0.95 ** (np.arange(1000) / 2) * np.cos(np.arccos(0.9 / np.sqrt(0.95)) * np.arange(1000))
    quiet, loud = (colour_of(series(noise), 1.0, False) for noise in (kept_up, kept_up + excited))
    assert quiet is not None and loud is not None
    assert quiet.excited < 2.5 and loud.excited > 10
    assert loud.std == pytest.approx(1.0, abs=0.1) and quiet.std == pytest.approx(1.0, abs=0.1)


def test_a_random_walk_has_no_level_and_slow_noise_has_one():
    random = np.random.default_rng(6)
    for _ in range(60):
        walk = colour_of(series(np.cumsum(random.standard_normal(600))), 1.0, False)
        assert walk is not None and not walk.has_level
        slow = colour_of(
            series(np.asarray(lfilter([1.0], [1.0, -0.8], random.standard_normal(1100)))[500:]), 1.0, False
        )
        assert slow is not None and slow.has_level


def test_a_hum_and_a_drift_are_functions_of_time_beside_the_noise():
    noise = np.random.default_rng(3).standard_normal(4000)
    run = series(noise)
    # A row is the mean over its time.
    hum, drift = 60 * np.sinc(0.05002) * np.sin(2 * np.pi * 50.02 * run.t + 0.7), 100 * (run.t - run.t.mean())
    run = run._replace(residual=noise + hum + drift, slopes=run.slopes[:, :1])
    colour = colour_of(run, 1.0, True)
    assert colour is not None and colour.drift and not colour.coefficients.size
    assert colour.lines == pytest.approx((50.02,), abs=2e-3)
    # The amplitudes are those added to the model, hence the minus sign. The drift is given over the whole series.
    assert colour.sizes[0] == pytest.approx(-100 * np.ptp(run.t), abs=0.5)
    assert np.hypot(*colour.sizes[1:]) == pytest.approx(60, abs=0.15)
    residual, _ = whitened(run, colour)
    assert colour.std == pytest.approx(1.0, abs=0.05) and np.std(residual) == pytest.approx(1.0, abs=0.05)


def test_what_functions_take_of_slow_noise_is_made_good():
    """Compare the scatter of eight amplitudes with their standard errors.

    The functions lie in the band of a motion, the noise is a random walk. A process fitted to the
    residuals alone would give errors too small by a factor of 1.8. With so few rows, no estimate is exact.
    """
    random, rows = np.random.default_rng(4), 160
    t = np.arange(rows) / rows
    slopes = np.column_stack([f(k * np.pi * t) for k in (3, 4, 5, 6) for f in (np.cos, np.sin)])
    scores = []
    for _ in range(150):
        run = Series(t, np.cumsum(random.standard_normal(rows)), slopes, np.ones(rows), START, np.zeros((rows, 0)))
        colour = colour_of(run, 1.0, False)
        assert colour is not None
        residual, along = whitened(run, colour)
        covariance = np.linalg.inv(along.T @ along)
        scores.append(covariance @ along.T @ residual / np.sqrt(np.diag(covariance)))
    assert 0.8 < np.sqrt(np.mean(np.square(scores))) < 1.45
