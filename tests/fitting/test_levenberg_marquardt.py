"""The solver against SciPy on classic problems, its invariances, its walls, and what it says at the end."""

import functools

import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from fricjax.fitting.levenberg_marquardt import CONVERGED, NOT_FINITE, STALLED, LevenbergMarquardt

T = np.linspace(0.0, 2.0, 40)
NOISE = np.random.default_rng(3).standard_normal((3, T.size))
LINE = 2.0 - 3.0 * T + 0.1 * NOISE[0]
DECAY = 5.0 * np.exp(-1.7 * T) + 0.5 + 0.05 * NOISE[1]


def line(p, args=None):
    return p[0] + p[1] * jnp.asarray(T) - LINE


def decay(p, args=None):
    return p[0] * jnp.exp(-p[1] * jnp.asarray(T)) + p[2] - DECAY


def rosenbrock(p, args=None):
    # The constant keeps the smallest sum of squares away from zero, as noise does.
    return jnp.stack([10 * (p[1] - p[0] ** 2), 1 - p[0], jnp.asarray(0.1), jnp.asarray(-0.1)])


def powell(p, args=None):
    return jnp.stack(
        [
            p[0] + 10 * p[1],
            5**0.5 * (p[2] - p[3]),
            (p[1] - 2 * p[2]) ** 2,
            10**0.5 * (p[0] - p[3]) ** 2,
            1e-3 + 0 * p[0],
        ]
    )


def solve(fn, start, *, lower: object = -np.inf, upper: object = np.inf, floor=0.0, max_steps=200):
    start = jnp.asarray(start, float)
    options = {
        "lower": jnp.broadcast_to(jnp.asarray(lower, float), start.shape),
        "upper": jnp.broadcast_to(jnp.asarray(upper, float), start.shape),
        "dof": jnp.asarray(float(max(fn(start).size - start.size, 1))),
        "floor": jnp.asarray(floor),
    }
    return optx.least_squares(fn, LevenbergMarquardt(), start, options=options, max_steps=max_steps, throw=False)


def status(solution):
    return int(solution.stats["status"])


@functools.cache
def reference(fn, start, bounds=None):
    box = (-np.inf, np.inf) if bounds is None else tuple(map(list, bounds))
    numpy_fn = lambda p: np.asarray(fn(jnp.asarray(p)))
    found = scipy_least_squares(numpy_fn, start, bounds=box, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * 2 * found.cost / max(found.fun.size - found.x.size, 1)
    return found.x, found.cost, np.sqrt(np.diag(covariance))


CASES = {
    "line": (line, (0.0, 0.0)),
    "decay": (decay, (1.0, 1.0, 0.0)),
    "decay from afar": (decay, (40.0, 8.0, -10.0)),
    "rosenbrock": (rosenbrock, (-1.2, 1.0)),
    "powell": (powell, (3.0, -1.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_it_finds_the_optimum_of_scipy(name):
    fn, start = CASES[name]
    x, cost, std = reference(fn, start)
    found = solve(fn, start)
    assert status(found) == CONVERGED
    assert float(found.stats["cost"]) == pytest.approx(cost, rel=1e-6)
    assert np.all(np.abs(np.asarray(found.value) - x) < 2e-3 * std + 1e-12)


def test_a_linear_problem_is_done_after_one_step():
    found = solve(line, (0.0, 0.0))
    slope, intercept = np.polyfit(T, LINE, 1)
    assert np.asarray(found.value) == pytest.approx([intercept, slope], rel=1e-4)
    # The first pass measures the start; the damping of the first step leaves a last small one.
    assert int(found.stats["num_steps"]) <= 3


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


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name", ["decay", "rosenbrock"])
def test_scaling_the_residuals_changes_nothing(name, factor):
    fn, start = CASES[name]
    plain = solve(fn, start)
    scaled = solve(lambda p, args=None: factor * fn(p), start)
    assert status(scaled) == status(plain) == CONVERGED
    assert int(scaled.stats["num_steps"]) == int(plain.stats["num_steps"])
    assert np.asarray(scaled.value) == pytest.approx(np.asarray(plain.value), rel=1e-9)


@pytest.mark.parametrize("factors", [(1e6, 1e-6, 1.0), (1e-6, 1e6, 1e3)])
def test_scaling_the_parameters_changes_nothing(factors):
    unit, start = jnp.asarray(factors), np.asarray(CASES["decay"][1])
    plain = solve(decay, start)
    scaled = solve(lambda p, args=None: decay(p / unit), start * np.asarray(factors))
    assert status(scaled) == status(plain) == CONVERGED
    assert int(scaled.stats["num_steps"]) == int(plain.stats["num_steps"])
    assert np.asarray(scaled.value / unit) == pytest.approx(np.asarray(plain.value), rel=1e-9)


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
    assert status(found) == CONVERGED
    assert np.all((value >= lower) & (value <= upper))
    assert float(found.stats["cost"]) == pytest.approx(cost, rel=1e-5)
    assert np.all(np.abs(value - x) < 5e-3 * std + 1e-5)


def test_a_start_at_a_bound_can_leave_it():
    found = solve(decay, (5.0, 0.0, 0.5), lower=(0.0, 0.0, 0.0), upper=(9.0, 9.0, 9.0))
    assert status(found) == CONVERGED
    assert np.asarray(found.value) == pytest.approx(reference(decay, (1.0, 1.0, 0.0))[0], rel=1e-3)


def test_a_parameter_between_equal_bounds_stays():
    found = solve(decay, (1.0, 1.7, 0.0), lower=(-9.0, 1.7, -9.0), upper=(9.0, 1.7, 9.0))
    wave = np.stack([np.exp(-1.7 * T), np.ones_like(T)], axis=1)
    linear = np.linalg.lstsq(wave, DECAY, rcond=None)[0]
    assert float(found.value[1]) == 1.7
    assert np.asarray(found.value)[[0, 2]] == pytest.approx(linear, rel=1e-4)


def test_a_start_that_is_not_finite_is_said_to_be_so():
    found = solve(lambda p, args=None: decay(p) + jnp.log(p[0]), (-1.0, 1.0, 0.0))
    assert status(found) == NOT_FINITE
    assert np.asarray(found.value) == pytest.approx([-1.0, 1.0, 0.0], rel=1e-12)
    assert np.all(np.isnan(np.asarray(found.stats["normal"])))


def test_a_step_beyond_a_wall_of_nan_is_rejected():
    """From -1.5 the Gauss-Newton step on atan(p - 1) overshoots to 7, behind the wall; the optimum lies before it."""
    start, wall = -1.5, 3.0
    assert start - np.arctan(start - 1) * (1 + (start - 1) ** 2) > wall
    fn = lambda p, args=None: jnp.where(
        p[0] < wall, jnp.stack([jnp.arctan(p[0] - 1), jnp.asarray(0.1), jnp.asarray(0.1)]), jnp.nan
    )
    found = solve(fn, (start,))
    assert status(found) == CONVERGED
    assert float(found.value[0]) == pytest.approx(1.0, abs=1e-3)
    assert np.isfinite(float(found.stats["cost"]))


def test_an_optimum_behind_a_wall_is_not_called_converged():
    found = solve(lambda p, args=None: jnp.where(p[0] < 4.0, decay(p), jnp.nan), (1.0, 1.0, 0.0))
    assert status(found) == STALLED
    assert float(found.value[0]) < 4.0 and np.isfinite(float(found.stats["cost"]))


def test_a_better_residual_whose_jacobian_is_not_finite_is_never_accepted():
    """The optimum at 5 lies where the root has no derivative; the fit gets up to 3 and says that it is stuck."""
    root = lambda p: 1e-3 * jnp.sqrt(jnp.maximum(3 - p[0], 0.0))
    found = solve(lambda p, args=None: jnp.stack([p[0] - 5 + root(p), 0.1 + 0 * p[0], 0.1 + 0 * p[0]]), (0.0,))
    assert status(found) == STALLED
    assert float(found.value[0]) < 3
    assert np.all(np.isfinite(np.asarray(found.stats["normal"])))


def test_a_kink_stalls():
    found = solve(lambda p, args=None: jnp.concatenate([1 + jnp.abs(p), jnp.ones(2)]), (0.3,))
    assert status(found) in (STALLED, CONVERGED)
    assert abs(float(found.value[0])) < 1e-3


def test_running_out_of_steps_is_told_by_the_result():
    found = solve(rosenbrock, (-1.2, 1.0), max_steps=3)
    assert bool(found.result == optx.RESULTS.nonlinear_max_steps_reached)
    assert int(found.stats["num_steps"]) == 3
    assert status(found) not in (CONVERGED, STALLED, NOT_FINITE)


def test_data_without_noise_end_at_the_floor_of_rounding():
    exact = 5.0 * np.exp(-1.7 * T) + 0.5
    fn = lambda p, args=None: (p[0] * jnp.exp(-p[1] * jnp.asarray(T)) + p[2] - exact) / 1e-9
    found = solve(fn, (1.0, 1.0, 0.0), floor=float(T.size * (1e-12 * 5.5 / 1e-9) ** 2))
    assert status(found) == CONVERGED
    assert np.asarray(found.value) == pytest.approx([5.0, 1.7, 0.5], rel=1e-10)


def test_a_direction_without_effect_does_not_stop_the_others():
    found = solve(lambda p, args=None: line(jnp.stack([p[0] + p[2], p[1]])), (0.0, 0.0, 1.0))
    slope, intercept = np.polyfit(T, LINE, 1)
    assert status(found) == CONVERGED
    assert float(found.value[1]) == pytest.approx(slope, rel=1e-4)
    assert float(found.value[0] + found.value[2]) == pytest.approx(intercept, rel=1e-4)
