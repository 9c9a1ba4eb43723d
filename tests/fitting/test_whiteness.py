"""Whiteness tests on noise of known correlation."""

import numpy as np
import pytest

from fricjax.fitting.noise import Whiteness, whiteness


def autoregressive(phi: float, n: int, seed: int) -> np.ndarray:
    """Stationary process x[i] = phi x[i-1] + e[i] with unit variance."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    e = np.sqrt(1 - phi**2) * rng.standard_normal(n)
    e[0] = rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -phi], e))


@pytest.mark.parametrize("n", [100, 2000])
def test_white_noise_is_called_white(n):
    verdicts = [whiteness(np.random.default_rng(seed).standard_normal(n)) for seed in range(400)]
    assert np.mean([verdict.white for verdict in verdicts]) >= 0.99
    assert np.median([verdict.correlation_time for verdict in verdicts]) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("phi", [0.3, 0.8, 0.95, 0.99])
def test_the_correlation_time_of_an_autoregressive_process(phi):
    verdicts = [whiteness(autoregressive(phi, 40_000, seed)) for seed in range(20)]
    expected = (1 + phi) / (1 - phi)
    assert np.mean([verdict.correlation_time for verdict in verdicts]) == pytest.approx(expected, rel=0.15)
    assert np.mean([verdict.lag_one for verdict in verdicts]) == pytest.approx(phi, abs=0.01)
    assert not any(verdict.white for verdict in verdicts)


def test_the_scale_and_the_mean_do_not_matter():
    x = autoregressive(0.8, 5000, 3)
    scaled = whiteness(1e-9 * x + 1e-6)
    assert scaled.correlation_time == pytest.approx(whiteness(x).correlation_time, rel=1e-6)


def test_alternating_residuals_are_not_white_but_do_not_shrink_the_samples():
    verdict = whiteness(autoregressive(-0.5, 5000, 1))
    assert not verdict.white and verdict.lag_one < 0 and verdict.correlation_time == 1.0


@pytest.mark.parametrize("residuals", [np.zeros(100), np.ones(100), np.arange(5.0), np.full(100, np.nan)])
def test_what_tells_nothing_is_no_reason_for_a_warning(residuals):
    assert whiteness(residuals).white


def test_a_slow_wave_correlates_over_its_period():
    verdict = whiteness(np.sin(np.linspace(0, 20 * np.pi, 10_000)) + 0.1 * autoregressive(0.0, 10_000, 2))
    assert not verdict.white and 100 < verdict.correlation_time < 1000


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_residuals_that_are_not_finite_tell_nothing(value):
    assert whiteness(np.r_[np.ones(50), value]) == Whiteness(0.0, 1.0, True)
