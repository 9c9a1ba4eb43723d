"""Effects of the instrument against their formulas, and their order."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fricjax.instrument import Interferometer

T = np.arange(400) / 1e3 + 0.5
X = 1e-3 * np.cos(80 * T)
V = -0.08 * np.sin(80 * T)


def generators(seed: int = 0) -> dict[str, np.random.Generator]:
    return {name: np.random.default_rng((seed, i)) for i, name in enumerate(("sampling_jitter", "noise"))}


def seen(**keywords) -> np.ndarray:
    return Interferometer(**{"noise": 0.0, **keywords}).observe(T, X, V, generators())[0]


def test_a_perfect_instrument_shows_the_motion():
    x, steps = Interferometer(noise=0.0).observe(T, X, V, generators())
    assert x is X
    assert steps == ()


def test_offset_and_drift():
    np.testing.assert_allclose(seen(offset=3e-6), X + 3e-6, rtol=0, atol=1e-18)
    np.testing.assert_allclose(seen(drift=2e-8), X + 2e-8 * (T - T[0]), rtol=0, atol=1e-18)


def test_scale_error():
    np.testing.assert_allclose(seen(scale_error=1e-7) - X, 1e-7 * X, rtol=0, atol=1e-18)


@given(step=st.floats(1e-10, 1e-6))
def test_quantisation_leaves_whole_counts_within_half_a_step(step):
    x = seen(quantisation=step)
    counts = x / step
    assert np.abs(counts - np.round(counts)).max() < 1e-6
    assert np.abs(x - X).max() <= 0.5 * step * (1 + 1e-9) + 1e-18


@pytest.mark.parametrize(("passes", "fringe"), [(1, 633e-9 / 2), (2, 633e-9 / 4)])
def test_periodic_nonlinearity(passes, fringe):
    x = seen(periodic_nonlinearity=(2e-9, 0.7e-9), passes=passes)
    phase = 2 * np.pi * X / fringe
    np.testing.assert_allclose(x, X + 2e-9 * np.sin(phase) + 0.7e-9 * np.sin(2 * phase), rtol=0, atol=1e-17)


def test_one_number_is_the_first_order():
    np.testing.assert_array_equal(seen(periodic_nonlinearity=2e-9), seen(periodic_nonlinearity=(2e-9, 0.0)))


def test_jitter_is_velocity_times_delay():
    delays = (seen(sampling_jitter=20e-9) - X) / V
    late = generators()["sampling_jitter"]
    np.testing.assert_allclose(delays, 20e-9 * late.standard_normal(X.size), rtol=1e-4, atol=1e-13)


def test_white_noise_is_normal_and_white():
    n = 100_000
    still = np.zeros(n)
    noise = Interferometer(noise=2e-9).observe(still, still, still, generators())[0] / 2e-9
    assert abs(noise.mean()) < 5 / np.sqrt(n)
    assert abs(noise.var() - 1) < 5 * np.sqrt(2 / n)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 5 / np.sqrt(n)


def test_the_order_is_that_of_the_light():
    keywords: dict[str, Any] = {
        "sampling_jitter": 1e-8,
        "scale_error": 1e-4,
        "offset": 1e-6,
        "drift": 1e-7,
        "periodic_nonlinearity": 2e-9,
        "noise": 1e-9,
        "quantisation": 3e-10,
    }
    x, steps = Interferometer(**keywords).observe(T, X, V, generators())
    assert [step.name for step in steps] == list(keywords)
    late, loud = generators().values()
    path = (X + V * 1e-8 * late.standard_normal(X.size)) * (1 + 1e-4) + 1e-6 + 1e-7 * (T - T[0])
    shown = path + 2e-9 * np.sin(4 * np.pi * path / 633e-9) + 1e-9 * loud.standard_normal(X.size)
    np.testing.assert_allclose(x, np.round(shown / 3e-10) * 3e-10, rtol=0, atol=1e-16)


def test_sigma_is_noise_and_rounding_together():
    assert Interferometer(noise=1e-9).sigma == pytest.approx(1e-9, rel=1e-15)
    assert Interferometer(noise=3e-9, quantisation=4e-9 * np.sqrt(12)).sigma == pytest.approx(5e-9, rel=1e-12)
