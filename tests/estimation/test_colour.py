"""The colour of noise against processes whose coefficients are known, and least squares that count by it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fricjax.estimation.colour import Series, autoregression, colour_of, weighed

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
    residual, slopes = weighed(run, colour)
    assert slopes.shape == (residual.size, 2)
    assert np.std(residual) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(residual[1:] * residual[:-1])) < 4 / np.sqrt(residual.size)


def test_a_hum_and_a_drift_are_functions_of_time_beside_the_noise():
    noise = np.random.default_rng(3).standard_normal(4000)
    run = series(noise)
    # A row is the mean over its time.
    hum, drift = 60 * np.sinc(0.05002) * np.sin(2 * np.pi * 50.02 * run.t + 0.7), 100 * (run.t - run.t.mean())
    run = run._replace(residual=noise + hum + drift, slopes=run.slopes[:, :1])
    colour = colour_of(run, 1.0, True)
    assert colour is not None and colour.drift and not colour.coefficients.size
    assert colour.lines == pytest.approx((50.02,), abs=2e-3)
    # What is added to the model to make up for them is their opposite; the drift is told over the whole series.
    assert colour.sizes[0] == pytest.approx(-100 * np.ptp(run.t), abs=0.5)
    assert np.hypot(*colour.sizes[1:]) == pytest.approx(60, abs=0.15)
    residual, _ = weighed(run, colour)
    assert colour.std == pytest.approx(1.0, abs=0.05) and np.std(residual) == pytest.approx(1.0, abs=0.05)


def test_what_functions_take_of_slow_noise_is_made_good():
    """Sizes of eight functions in the band of a motion, beside a random walk, scatter by the errors its colour tells.

    By a process of the residuals alone the errors would be too small by 1.8; of so few rows none tells them to the end.
    """
    random, rows = np.random.default_rng(4), 160
    t = np.arange(rows) / rows
    slopes = np.column_stack([f(k * np.pi * t) for k in (3, 4, 5, 6) for f in (np.cos, np.sin)])
    scores = []
    for _ in range(150):
        run = Series(t, np.cumsum(random.standard_normal(rows)), slopes, np.ones(rows), START, np.zeros((rows, 0)))
        colour = colour_of(run, 1.0, False)
        assert colour is not None
        residual, along = weighed(run, colour)
        covariance = np.linalg.inv(along.T @ along)
        scores.append(covariance @ along.T @ residual / np.sqrt(np.diag(covariance)))
    assert 0.8 < np.sqrt(np.mean(np.square(scores))) < 1.45
