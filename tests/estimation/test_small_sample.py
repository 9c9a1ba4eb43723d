"""The small-sample term of a covariance against simulated noise.

The term covers the uncertainty of a noise process that is estimated from the same record.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from fricjax.estimation.autoregression import gram, innovations
from fricjax.estimation.colour import Colour, Series, colour_of, white, whitened
from fricjax.estimation.small_sample import covariance_by_noise, small_sample_covariance

START = np.array([0])
RING = np.array([2 * 0.95 * np.cos(0.1), -(0.95**2)])
"""Of noise that rings for twenty rows at a tenth of a radian per row."""


def series(noise: np.ndarray, waves: tuple[int, ...]) -> Series:
    t = np.arange(noise.size) / noise.size
    slopes = np.column_stack([f(k * np.pi * t) for k in waves for f in (np.cos, np.sin)])
    return Series(t, noise, slopes, np.ones(noise.size), START, np.zeros((noise.size, 0)))


def drawn(random: np.random.Generator, rows: int, process: np.ndarray = RING) -> np.ndarray:
    return np.asarray(lfilter([1.0], [1.0, *-process], random.standard_normal(rows + 500)))[500:]


def estimated(run: Series, coefficients: np.ndarray) -> np.ndarray:
    both = innovations(np.column_stack([run.residual, run.slopes]), run.starts, coefficients)
    return np.linalg.lstsq(both[:, 1:], -both[:, 0])[0]


def test_estimates_move_with_the_process_as_by_differences():
    random, rows, step = np.random.default_rng(0), 400, 1e-5
    run = series(drawn(random, rows), (10, 13))
    fitted = run.residual + run.slopes @ estimated(run, RING)
    colour = white(run, 1.3**2)._replace(coefficients=RING, left=fitted)
    _, along = whitened(run, colour)
    covariance = np.linalg.inv(along.T @ along)
    added, scatter = covariance_by_noise(run, colour, covariance)

    products, n = gram(fitted, START, RING.size)
    known = 1.3**2 * np.linalg.inv(products[1:, 1:])
    ends = [[estimated(run, RING + side * step * unit) for side in (-1, 1)] for unit in np.eye(2)]
    moves = np.array([(after - before) / (2 * step) for before, after in ends])
    np.testing.assert_allclose(added, moves.T @ known @ moves, rtol=1e-3)

    # Scatter of the diagonal, from finite differences of the covariance.
    # Its overall size also scatters like a sum of n squares.
    def diagonal(coefficients: np.ndarray) -> np.ndarray:
        _, along = whitened(run, colour._replace(coefficients=coefficients))
        return np.diag(np.linalg.inv(along.T @ along))

    slopes = np.array(
        [(diagonal(RING + step * unit) - diagonal(RING - step * unit)) / (2 * step) for unit in np.eye(2)]
    )
    expected = np.einsum("ip,ij,jp->p", slopes, known, slopes) + 2 / n * np.diag(covariance) ** 2
    np.testing.assert_allclose(scatter, expected, rtol=1e-4)

    # The term counts twice, because the covariance itself is too small by the same amount.
    # The denominator is the width of Student's t.
    few = expected / np.diag(covariance) ** 2
    assert np.max(few) < 0.5
    told = covariance + small_sample_covariance([(run, colour)], covariance)
    whole = covariance + 2 * moves.T @ known @ moves
    np.testing.assert_allclose(told, whole / np.sqrt(np.outer(1 - few, 1 - few)), rtol=1e-3)


def test_white_noise_adds_nothing():
    run = series(np.random.default_rng(1).standard_normal(300), (3,))
    assert not small_sample_covariance([(run, white(run, 1.0))], np.eye(2)).any()


def test_functions_that_are_fitted_besides_take_their_share():
    """Fit one function with the noise, then as a parameter.

    Both ways must give the other parameters the same errors.
    """
    whole = series(drawn(np.random.default_rng(2), 400), (10, 13))
    colour = white(whole, 1.0)._replace(coefficients=RING)
    part = whole._replace(slopes=whole.slopes[:, :3])
    beside: Colour = colour._replace(beside=whole.slopes[:, 3:], sizes=np.zeros(1))
    found = []
    for run, seen in ((whole, colour), (part, beside)):
        _, along = whitened(run, seen)
        covariance = np.linalg.inv(along.T @ along)
        found.append((covariance + small_sample_covariance([(run, seen)], covariance))[:3, :3])
    np.testing.assert_allclose(*found, rtol=1e-6)


@pytest.mark.slow
def test_intervals_hold_for_noise_that_forgets_a_few_times_only():
    """Check the coverage of intervals.

    Without the small-sample term, 84 of 100 intervals of 95 % contain the truth.
    """
    random, scores = np.random.default_rng(3), []
    process = np.array([2 * 0.97 * np.cos(0.02), -(0.97**2)])
    for _ in range(150):
        run = series(drawn(random, 640, process), (3, 4, 5, 6))
        colour = colour_of(run, 1.0, False)
        assert colour is not None
        residual, along = whitened(run, colour)
        covariance = np.linalg.inv(along.T @ along)
        whole = covariance + small_sample_covariance([(run, colour)], covariance)
        scores.append(covariance @ along.T @ residual / np.sqrt(np.diag(whole)))
    assert 0.875 < np.mean(np.abs(scores) < 1.96) < 0.98
