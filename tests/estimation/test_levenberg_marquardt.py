"""The solver against SciPy on classic problems, its invariances and its bounds."""

import functools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from fricjax.estimation import damped_step, marquardt
from fricjax.estimation.covariance import WEAKEST
from fricjax.estimation.levenberg_marquardt import LevenbergMarquardt
from fricjax.estimation.status import AT_BOUND, CONVERGED, UNDETERMINED, is_determined
from tests.fitting.problems import DECAY, EXACT, LINE, NOISY, T, clean_decay, decay, line, powell, solve, status, steps
from tests.tiers import cases


@functools.cache
def reference(fn, start, bounds=None):
    box = (-np.inf, np.inf) if bounds is None else tuple(map(list, bounds))
    numpy_fn = lambda p: np.asarray(fn(jnp.asarray(p)))
    found = scipy_least_squares(numpy_fn, start, bounds=box, xtol=1e-14, ftol=1e-14, gtol=1e-14, x_scale="jac")
    unit = np.linalg.norm(found.jac, axis=0)
    unit[unit == 0] = 1
    scaled = np.linalg.pinv((found.jac / unit).T @ (found.jac / unit)) / np.outer(unit, unit)
    variance = 2 * found.cost / max(found.fun.size - found.x.size, 1)
    return found.x, found.cost, np.sqrt(np.diag(scaled) * variance)


@pytest.mark.parametrize("name", NOISY)
def test_it_finds_the_optimum_of_scipy(name):
    fn, start = NOISY[name]
    x, cost, std = reference(fn, start)
    found = solve(fn, start)
    assert status(found) == CONVERGED
    assert float(found.stats["cost"]) == pytest.approx(cost, rel=1e-6)
    assert np.all(np.abs(np.asarray(found.value) - x) < 5e-3 * std + 1e-12)


@pytest.mark.parametrize("name", cases(EXACT, ["decay", "brown"]))
def test_rules_of_minpack_end_a_fit_that_leaves_no_residual(name):
    fn, start, optimum = EXACT[name]
    found = solve(fn, start)
    assert status(found) == CONVERGED
    assert steps(found) <= 30
    np.testing.assert_allclose(found.value, optimum, rtol=1e-10)


def test_a_singular_optimum_is_found_and_said_to_be_singular():
    found = solve(powell, (3.0, -1.0, 0.0, 1.0))
    assert status(found) == UNDETERMINED
    assert np.max(np.abs(np.asarray(found.value))) < 1e-6


def test_a_linear_problem_is_done_after_one_step():
    found = solve(line, (0.0, 0.0))
    slope, intercept = np.polyfit(T, LINE, 1)
    assert np.asarray(found.value) == pytest.approx([intercept, slope], rel=1e-4)
    # The first pass measures the start. The first step is damped, so a small second one follows.
    assert steps(found) <= 3


@pytest.mark.parametrize(
    ("module", "constant", "value"),
    [
        (marquardt, "_SCATTER", 0.01),
        pytest.param(marquardt, "_SCATTER", 0.005, marks=pytest.mark.slow),
        pytest.param(marquardt, "_SCATTER", 0.02, marks=pytest.mark.slow),
        pytest.param(marquardt, "_FORESEEN", 0.5, marks=pytest.mark.slow),
        pytest.param(marquardt, "_FORESEEN", 0.9, marks=pytest.mark.slow),
        pytest.param(damped_step, "_TAKEN", 0.25, marks=pytest.mark.slow),
        pytest.param(damped_step, "_TAKEN", 0.75, marks=pytest.mark.slow),
    ],
)
def test_a_step_within_the_scatter_is_not_damped(module, constant, value, monkeypatch):
    """Check that two passes are enough near the optimum.

    On the scale of the scatter the residual is nearly linear.
    The first pass measures the start, the second one the optimum.
    """
    monkeypatch.setattr(module, constant, value)
    t = np.linspace(0.0, 2.0, 4000)
    seen = 5.0 * np.exp(-1.7 * t) + 0.5 + 0.005 * np.random.default_rng(4).standard_normal(t.size)
    of = lambda p, _=None: p[0] * jnp.exp(-p[1] * t) + p[2] - seen
    x, _, std = reference(of, (1.0, 1.0, 0.0))
    found = solve(of, (5.0, 1.7, 0.5))
    assert (status(found), steps(found)) == (CONVERGED, 2)
    assert np.all(np.abs(np.asarray(found.value) - x) < 5e-3 * std)


def test_a_step_within_the_scatter_that_fails_is_damped():
    """Start where the Gauss-Newton step on an arc tangent overshoots.

    The step is short compared with the other residuals.
    """
    of = lambda p, _=None: jnp.concatenate([jnp.arctan(5 * p), 3.0 * (-1.0) ** jnp.arange(40)])
    found = solve(of, (1.0,))
    assert status(found) == CONVERGED and steps(found) < 15
    # The failed step must not cost precision: a thousandth of the standard error.
    assert abs(float(found.value[0])) < 1e-3 * 3 / 5


def test_a_start_at_an_exact_optimum_takes_one_pass():
    found = solve(clean_decay, (5.0, 1.7, 0.5))
    assert (status(found), steps(found)) == (CONVERGED, 1)


def test_the_normal_matrix_and_the_cost_belong_to_the_answer():
    found = solve(decay, (1.0, 1.0, 0.0))
    p = np.asarray(found.value)
    wave = np.exp(-p[1] * T)
    jacobian = np.stack([wave, -p[0] * T * wave, np.ones_like(T)], axis=1)
    assert np.asarray(found.stats["normal"]) == pytest.approx(jacobian.T @ jacobian, rel=1e-10)
    assert float(found.stats["cost"]) == pytest.approx(
        float(np.sum(np.asarray(decay(found.value)) ** 2)) / 2, rel=1e-12
    )
    assert float(found.stats["remaining"]) < 1e-6


@pytest.mark.parametrize("name", cases(["decay", "rosenbrock", "meyer"], ["decay"]))
def test_scaling_the_residuals_changes_nothing(name):
    fn, start = NOISY[name]
    scaled = lambda p, factor: factor * fn(p)
    plain, *others = (solve(scaled, start, args=jnp.asarray(factor)) for factor in (1.0, 1e-6, 1e6))
    for other in others:
        assert status(other) == status(plain) == CONVERGED
        assert steps(other) == steps(plain)
        assert np.asarray(other.value) == pytest.approx(np.asarray(plain.value), rel=1e-9)


@pytest.mark.parametrize("fn", [decay, clean_decay])
def test_scaling_the_parameters_changes_nothing(fn):
    start, scaled = np.asarray([1.0, 1.0, 0.0]), lambda p, units: fn(p / units)
    plain = solve(scaled, start, args=jnp.ones(3))
    for units in [(1e6, 1e6, 1e6), (1e-6, 1e-6, 1e-6), (1e6, 1e-6, 1.0), (1e-6, 1e6, 1e3)]:
        found = solve(scaled, start * units, args=jnp.asarray(units))
        assert status(found) == status(plain) == CONVERGED
        assert steps(found) == steps(plain)
        assert np.asarray(found.value) / units == pytest.approx(np.asarray(plain.value), rel=1e-9)


BOXES = {
    "inactive": ((-10.0, -10.0, -10.0), (10.0, 10.0, 10.0)),
    "one at its upper bound": ((0.0, 0.0, -1.0), (4.0, 5.0, 1.0)),
    "one at its lower bound": ((-10.0, 2.5, -1.0), (10.0, 9.0, 1.0)),
    "two at bounds": ((0.0, 0.0, 0.6), (4.0, 9.0, 9.0)),
    "start outside of the optimum's corner": ((0.0, 0.0, -10.0), (10.0, 1.5, 0.2)),
}


@pytest.mark.parametrize("name", BOXES)
@pytest.mark.parametrize("start", [(1.0, 3.0, 0.7), (4.0, 2.6, 0.8)])
def test_bounds_like_the_reflective_method_of_scipy(name, start):
    lower, upper = BOXES[name]
    inside = tuple(np.clip(start, lower, upper))
    x, cost, std = reference(
        decay, tuple(np.clip(start, np.add(lower, 1e-3), np.subtract(upper, 1e-3))), (lower, upper)
    )
    found = solve(decay, inside, lower=lower, upper=upper)
    value = np.asarray(found.value)
    assert status(found) == (CONVERGED if name == "inactive" else AT_BOUND)
    assert np.all((value >= lower) & (value <= upper))
    assert float(found.stats["cost"]) == pytest.approx(cost, rel=1e-5)
    assert np.all(np.abs(value - x) < 5e-3 * std + 1e-5)


def test_a_start_at_a_bound_can_leave_it():
    found = solve(decay, (5.0, 0.0, 0.5), lower=(0.0, 0.0, 0.0), upper=(9.0, 9.0, 9.0))
    assert status(found) == CONVERGED
    assert np.asarray(found.value) == pytest.approx(reference(decay, (1.0, 1.0, 0.0))[0], rel=1e-3)


def test_a_parameter_between_equal_bounds_stays_and_is_no_bound_that_was_met():
    found = solve(decay, (1.0, 1.7, 0.0), lower=(-9.0, 1.7, -9.0), upper=(9.0, 1.7, 9.0))
    wave = np.stack([np.exp(-1.7 * T), np.ones_like(T)], axis=1)
    linear = np.linalg.lstsq(wave, DECAY, rcond=None)[0]
    assert status(found) == CONVERGED
    assert float(found.value[1]) == 1.7
    assert np.asarray(found.value)[[0, 2]] == pytest.approx(linear, rel=1e-4)


def test_more_parameters_than_residuals():
    found = solve(lambda p, args=None: jnp.stack([p[0] + p[1] - 3.0, p[1] * p[2] - 2.0]), (1.0, 1.0, 1.0))
    assert status(found) == UNDETERMINED
    a, b, c = map(float, found.value)
    assert (a + b, b * c) == pytest.approx((3.0, 2.0), rel=1e-10)


def test_a_direction_without_effect_does_not_stop_the_others():
    found = solve(lambda p, args=None: line(jnp.stack([p[0] + p[2], p[1]])), (0.0, 0.0, 1.0))
    slope, intercept = np.polyfit(T, LINE, 1)
    assert status(found) == UNDETERMINED
    assert float(found.value[1]) == pytest.approx(slope, rel=1e-4)
    assert float(found.value[0] + found.value[2]) == pytest.approx(intercept, rel=1e-4)


def test_a_parameter_without_effect_is_undetermined_unless_it_is_fixed():
    fn = lambda p, args=None: line(p[:2])
    assert status(solve(fn, (0.0, 0.0, 1.0))) == UNDETERMINED
    assert status(solve(fn, (0.0, 0.0, 1.0), lower=(-9.0, -9.0, 1.0), upper=(9.0, 9.0, 1.0))) == CONVERGED


@pytest.mark.slow
def test_forty_parameters_are_solved_for_too():
    target = jnp.asarray(np.random.default_rng(1).standard_normal(40))
    found = solve(lambda p, args=None: jnp.sinh(p) - target, np.zeros(40), solver=LevenbergMarquardt())
    assert status(found) == CONVERGED
    np.testing.assert_allclose(found.value, np.arcsinh(target), rtol=1e-10)


@pytest.mark.parametrize("weakest", [1e-16, 0.2 * WEAKEST, 5 * WEAKEST, 1e-9])
def test_a_direction_is_determined_as_its_eigenvalue_says(weakest):
    """Use matrices with one weak direction, in widely different units."""
    random = np.random.default_rng(2)
    for n in (2, 5, 9):
        across = np.linalg.qr(random.standard_normal((n, n)))[0]
        matrix = (across * np.r_[weakest, np.ones(n - 1)]) @ across.T
        units = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(units, units)
        told = np.linalg.eigvalsh(scaled)[0] > WEAKEST
        size = 10.0 ** random.uniform(-6, 6, n)
        assert bool(is_determined(jnp.asarray(scaled * np.outer(size, size)), jnp.ones(n, bool))) == told
