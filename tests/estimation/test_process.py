"""The Kalman filter against the dense covariance matrix of the same process."""

import numpy as np
import pytest

from fricjax.estimation.process import StateTransition, filtered, kicks_of

ROWS = 80
STEP = np.array([[0.98, 0.15], [-0.2, 0.95]])
KICKED = np.array([[0.02, 0.05], [0.05, 0.3]])


@pytest.fixture
def transition() -> StateTransition:
    """Transition that halves the velocity once and rests at the end."""
    carried, kicked = np.tile(STEP, (ROWS, 1, 1)), np.tile(KICKED, (ROWS, 1, 1))
    carried[30] = np.diag([1.0, 0.5]) @ STEP
    carried[60:], kicked[60:] = np.diag([1.0, 0.0]), 0.0
    return StateTransition(carried, kicked, np.zeros(len(carried)))


def covariance(transition: StateTransition, unit: np.ndarray, kicks: float) -> np.ndarray:
    """Sum the covariance of the rows over all kicks.

    Each kick moves all later positions. Independent noise of variance one is added.
    """
    total = np.eye(ROWS)
    for i in range(ROWS):
        reaching, positions = np.eye(2), np.zeros((ROWS, 2))
        for j in range(i, ROWS):
            reaching = reaching if j == i else transition.matrix[j] @ reaching
            positions[j] = unit[j] * reaching[0]
        total += kicks * positions @ transition.noise[i] @ positions.T
    return total


@pytest.mark.parametrize("kicks", [0.0, 0.3, 50.0])
def test_the_squares_are_those_of_the_whole_covariance(transition, kicks):
    random = np.random.default_rng(0)
    columns, unit = random.standard_normal((ROWS, 4)), random.uniform(0.5, 2.0, ROWS)
    white, variances = filtered(columns, unit, transition, np.array([kicks, 1.0]))
    whole = covariance(transition, unit, kicks)
    assert white[0].T @ white[0] == pytest.approx(columns.T @ np.linalg.solve(whole, columns), rel=1e-9)
    assert np.sum(np.log(variances[0])) == pytest.approx(np.linalg.slogdet(whole)[1], rel=1e-9, abs=1e-9)


def test_the_strength_of_kicks_is_told_by_residuals(transition):
    """Estimate the strength although a fit absorbs part of the kicks."""
    random, unit = np.random.default_rng(1), np.ones(ROWS)
    root = np.linalg.cholesky(covariance(transition, unit, 4.0))
    slopes = np.column_stack([np.ones(ROWS), np.arange(ROWS) / ROWS])
    found = [kicks_of(3.0 * root @ random.standard_normal(ROWS), slopes, unit, transition) for _ in range(60)]
    # The logarithm of the estimates scatters symmetrically.
    assert np.mean(np.log([each.kicks for each in found])) == pytest.approx(np.log(4.0), abs=0.25)
    assert np.mean([each.std for each in found]) == pytest.approx(3.0, rel=0.05)


def test_the_units_of_residuals_and_derivatives_do_not_matter(transition):
    random, unit = np.random.default_rng(2), np.ones(ROWS)
    residual = np.linalg.cholesky(covariance(transition, unit, 4.0)) @ random.standard_normal(ROWS)
    slopes = random.standard_normal((ROWS, 2))
    one = kicks_of(residual, slopes, unit, transition)
    other = kicks_of(
        1e6 * residual,
        slopes * np.array([1e-9, 1e9]),
        1e-3 * unit,
        StateTransition(transition.matrix, 1e6 * transition.noise, transition.bend),
    )
    assert other.kicks == pytest.approx(one.kicks, rel=1e-6) and other.std == pytest.approx(1e6 * one.std, rel=1e-6)
    assert other.left == pytest.approx(1e6 * one.left, rel=1e-6, abs=1.0)
