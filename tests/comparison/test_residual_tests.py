"""Residual tests against exact counts and simulated sequences."""

import itertools

import numpy as np
import pytest
from scipy import stats

from fricjax.comparison.residual_tests import diagnose, resonance, signs

T, FREQUENCY = np.arange(1500) / 2500, 12.6


def noise(seed: int, n: int = T.size) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize(("up", "down"), [(4, 3), (2, 5), (1, 1)])
def test_rows_of_signs_by_counting_all_orders(up, down):
    orders = set(itertools.permutations([1.0] * up + [-1.0] * down))
    rows = np.array([1 + np.count_nonzero(np.diff(order)) for order in orders])
    found = [signs([np.array(order)]) for order in orders]
    assert sorted(one.rows for one in found) == sorted(rows)
    assert found[0].expected == pytest.approx(rows.mean())
    if rows.std() > 0:
        assert [one.score for one in found] == pytest.approx(
            (np.array([o.rows for o in found]) - rows.mean()) / rows.std()
        )


def test_rows_of_several_runs_add_up():
    first, second = np.array([1.0, -1.0, 1.0]), np.array([1.0, 1.0, -1.0, 0.0])
    both = signs([first, second])
    assert both.rows == 3 + 2
    assert both.expected == pytest.approx(sum(signs([part]).expected for part in (first, second)))


def test_the_chance_of_a_resonance_is_uniform_in_noise():
    chances = [resonance([T, T[:900]], [noise(seed), noise(seed + 1000, 900)], FREQUENCY).chance for seed in range(150)]
    assert stats.kstest(chances, "uniform").pvalue > 0.01


def test_a_motion_at_the_natural_frequency_is_seen_below_the_noise():
    hidden = 0.3 * np.sin(2 * np.pi * FREQUENCY * T + 1.0)
    tests = diagnose([T], [noise(5) + hidden], FREQUENCY)
    # The power relative to the mean is n a^2/4 = 1500 * 0.3^2/4.
    assert tests.resonance.ratio == pytest.approx(1 + 1500 * 0.09 / 4, rel=0.5)
    assert "resonance" in tests.failed
    assert diagnose([T], [noise(5)], FREQUENCY).failed == ()


def test_slow_residuals_fail_by_their_signs_and_neighbours():
    tests = diagnose([T], [noise(2) + 2 * np.sin(2 * np.pi * 0.7 * FREQUENCY * T)], FREQUENCY)
    assert {"white", "signs"} <= set(tests.failed)
    assert tests.signs.score < -5


def test_too_few_residuals_tell_of_no_resonance():
    assert np.isnan(resonance([T[:30]], [noise(1, 30)], FREQUENCY).chance)
    assert diagnose([T[:30]], [noise(1, 30)], FREQUENCY).failed == ()
