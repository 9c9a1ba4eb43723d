"""Estimated noise and resolution agree with those of synthetic records."""

import itertools

import numpy as np
import pytest

from fricjax.data.segmentation.disturbance import LONGEST, rest_spectrum
from fricjax.data.segmentation.noise import blocks, resolution, typical_interval, white_noise
from tests.tables import check_rows


def motion(samples, *, noise=0.0, rate=5e3, uneven=False):
    rng = np.random.default_rng(1)
    t = np.arange(samples) / rate
    t = np.sort(t + 0.3 / rate * rng.uniform(-1, 1, samples)) if uneven else t
    return t, 2e-3 * np.cos(80 * t) + noise * rng.standard_normal(samples)


def test_white_noise_of_a_motion():
    def check(samples, accuracy, uneven):
        t, x = motion(samples, noise=5e-9, uneven=uneven)
        assert white_noise(t, x) == pytest.approx(5e-9, rel=accuracy)

    sizes = [(3000, 0.08), (100_000, 0.02), (500_000, 0.02)]
    check_rows(check, [(*size, uneven) for size in sizes for uneven in (False, True)])


def test_a_motion_without_noise_has_none():
    assert white_noise(*motion(3000)) < 1e-15


def test_rounding_is_noise():
    t, x = motion(3000)
    assert white_noise(t, np.round(x / 1e-6) * 1e-6, 1e-6) == pytest.approx(1e-6 / np.sqrt(12), rel=0.05)


def test_noise_that_comes_and_goes_is_seen_in_all_of_a_long_record():
    t, x = motion(1_000_000)
    noise = np.where(np.arange(t.size) < t.size // 10, 1e-6, 5e-9)
    assert white_noise(t, x + noise * np.random.default_rng(0).standard_normal(t.size)) == pytest.approx(5e-9, rel=0.2)


def test_the_step_of_an_encoder():
    for samples, step in itertools.product([3000, 400_000], [1e-6, 0.309e-9]):
        _, x = motion(samples, rate=samples / 2)
        assert resolution(np.round(x / step) * step) == pytest.approx(step, rel=1e-6)


def test_continuous_values_have_no_step():
    for samples in (3000, 400_000):
        t, x = motion(samples, noise=5e-9, rate=samples / 2)
        assert resolution(x) == 0.0
        assert resolution(np.where(t < 1, x, x[t < 1][-1] + (x - motion(samples, rate=samples / 2)[1]))) == 0.0


def test_blocks_are_spread_over_a_long_record():
    short, long = np.arange(1000.0), np.arange(1_000_000.0)
    assert np.array_equal(blocks(short), [short])
    parts = blocks(long)
    assert parts.size == 2**17 and parts[0, 0] == 0 and parts[-1, -1] == long[-1]
    assert np.all(np.diff(parts) == 1)
    assert np.ptp(np.diff(parts[:, 0])) <= 1


def test_the_interval_is_that_of_most_samples():
    t = np.cumsum(np.tile([1e-3, 1e-3, 1e-3, 7e-3], 1000))
    assert typical_interval(t) == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize(("half_period", "resolved"), [(0.99 * LONGEST / 4e6, True), (1.01 * LONGEST / 4e6, False)])
def test_the_samples_of_a_spectrum_hold_two_cycles(half_period, resolved):
    """A longer rest is truncated, which keeps the size of a line."""
    t = np.arange(3 * LONGEST) / 1e6
    frequency, size = rest_spectrum(t, 2e-9 * np.cos(2 * np.pi * 1e4 * t), 0.0, half_period)
    assert bool(size.size) == resolved
    if resolved:
        assert frequency[np.argmax(size)] == pytest.approx(1e4, abs=8)
        assert size.max() == pytest.approx(2e-9, rel=0.15)
