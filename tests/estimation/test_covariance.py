"""The quadratic model of chi^2 against linear algebra.

The tests cover inverse, rank, bounds and the remaining distance to the optimum.
"""

import numpy as np
import pytest

from fricjax.estimation.covariance import quadratic

FREE = np.zeros(4, bool)
RNG = np.random.default_rng(8)
# Columns with very different units, such as a release time and a stiffness.
JACOBIAN = RNG.standard_normal((60, 4)) @ np.diag([1e9, 1.0, 1e-6, 1e3])
RESIDUAL = RNG.standard_normal(60)
NORMAL, GRADIENT = JACOBIAN.T @ JACOBIAN, JACOBIAN.T @ RESIDUAL


def test_step_and_inverse_are_those_of_least_squares():
    found = quadratic(GRADIENT, NORMAL, FREE)
    unit = np.sqrt(np.diag(NORMAL))
    pseudo = np.linalg.pinv(JACOBIAN / unit)
    assert found.step * unit == pytest.approx(-pseudo @ RESIDUAL, rel=1e-10)
    assert found.inverse * np.outer(unit, unit) == pytest.approx(pseudo @ pseudo.T, rel=1e-10)
    assert not found.undetermined.any()


def test_the_distance_is_the_root_of_what_the_sum_of_squares_still_loses():
    """Check the distance by Pythagoras.

    For a single parameter, the distance is the step over the standard error.
    """
    found = quadratic(GRADIENT, NORMAL, FREE)
    left = RESIDUAL + JACOBIAN @ found.step
    assert found.distance**2 == pytest.approx(RESIDUAL @ RESIDUAL - left @ left, rel=1e-10)
    single = quadratic(np.array([3.0]), np.array([[4.0]]), np.zeros(1, bool))
    assert single.distance == pytest.approx(abs(-3 / 4) / np.sqrt(1 / 4))


def test_no_parameter_moves_by_more_standard_errors_than_the_distance():
    found = quadratic(GRADIENT, NORMAL, FREE)
    pulls = np.abs(found.step) / np.sqrt(np.diag(found.inverse))
    assert np.max(pulls) <= found.distance
    # The bound is reached in the direction of the gradient: a gradient along one column of the inverse.
    along = quadratic(NORMAL @ found.inverse[:, 2], NORMAL, FREE)
    assert abs(along.step[2]) / np.sqrt(along.inverse[2, 2]) == pytest.approx(along.distance, rel=1e-9)


def test_a_parameter_at_its_bound_stands_still():
    held = np.array([False, True, False, False])
    found = quadratic(GRADIENT, NORMAL, held)
    keep = np.flatnonzero(~held)
    alone = quadratic(GRADIENT[keep], NORMAL[np.ix_(keep, keep)], FREE[keep])
    assert found.step[1] == 0 and not found.inverse[1].any() and not found.inverse[:, 1].any()
    assert found.step[keep] == pytest.approx(alone.step, rel=1e-12)
    assert found.distance == pytest.approx(alone.distance, rel=1e-12)
    assert found.at_bound is held and not found.undetermined.any()


def test_two_parameters_with_the_same_effect_are_undetermined_and_the_others_are_not():
    jacobian = np.column_stack([JACOBIAN, 7e3 * JACOBIAN[:, 1]])
    found = quadratic(jacobian.T @ RESIDUAL, jacobian.T @ jacobian, np.zeros(5, bool))
    assert found.undetermined.tolist() == [False, True, False, False, True]
    assert found.distance == pytest.approx(quadratic(GRADIENT, NORMAL, FREE).distance, rel=1e-9)


@pytest.mark.parametrize("rest", [1e-5, 1e-8])
def test_the_rank_does_not_depend_on_units(rest):
    """Check when two nearly equal columns are determined.

    A relative difference of 1e-5 between them is enough; 1e-8 is not.
    """
    jacobian = JACOBIAN.copy()
    jacobian[:, 3] = jacobian[:, 2] + rest * np.linalg.norm(jacobian[:, 2]) * RNG.standard_normal(60)
    for scale in (1e-12, 1.0, 1e12):
        units = np.array([1.0, 1.0, scale, 1.0])
        found = quadratic(units * (jacobian.T @ RESIDUAL), np.outer(units, units) * (jacobian.T @ jacobian), FREE)
        assert found.undetermined.tolist() == [False, False, rest < 1e-7, rest < 1e-7]


def test_a_parameter_without_effect_is_undetermined():
    normal = NORMAL.copy()
    normal[1] = normal[:, 1] = 0.0
    found = quadratic(GRADIENT * [1, 0, 1, 1], normal, FREE)
    assert found.undetermined.tolist() == [False, True, False, False]
    assert found.step[1] == 0 and np.isfinite(found.distance)


def test_what_is_not_finite_determines_nothing():
    found = quadratic(np.full(4, np.nan), np.full((4, 4), np.nan), FREE)
    assert found.undetermined.all() and not found.inverse.any()
    assert np.isnan(found.distance)
