"""Steps on a quadratic model.

The references are dense solutions, SciPy's bounded least squares, and the closed form of projection.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fricjax.estimation.damped_step import WEAKEST, bounded_steps, project, restricted_solve
from fricjax.estimation.levenberg_marquardt import LevenbergMarquardt
from fricjax.estimation.loss import Huber, Squares
from fricjax.estimation.passes import DensePasses, Pass, gather
from fricjax.estimation.status import CONVERGED
from tests.fitting.problems import DECAY, T, decay, options_for, solve, status, steps

step_of, gathered, solve_restricted = jax.jit(bounded_steps), jax.jit(gather), jax.jit(restricted_solve)


def a_pass(seed, p, units=1.0):
    generator = np.random.default_rng(seed)
    jacobian = generator.standard_normal((3 * p, p)) @ generator.standard_normal((p, p)) * units
    residual = generator.standard_normal(3 * p)
    return residual, jacobian, gathered(jnp.asarray(residual), jnp.asarray(jacobian), Squares())


@pytest.mark.parametrize("p", [1, 2, 5, 8, 40])
def test_damped_systems_like_dense_ones(p):
    units = 10.0 ** np.random.default_rng(p).uniform(-6, 6, p)
    _, jacobian, here = a_pass(p, p, units)
    free = np.random.default_rng(1).random((2, p)) < 0.7
    damping = np.stack([np.full(p, 0.3), np.full(p, 1e-3)])
    found = solve_restricted(here.normal, jnp.asarray(damping), jnp.asarray(free), -here.gradient[None])
    normal, gradient = jacobian.T @ jacobian, np.asarray(here.gradient)
    for got, use, strength in zip(np.asarray(found), free, damping, strict=True):
        damped = normal + np.diag(strength * np.diag(normal))
        scale = np.sqrt(np.diag(normal))[use]
        matrix = damped[np.ix_(use, use)] / np.outer(scale, scale)
        expected = np.linalg.solve(matrix, -gradient[use] / scale)
        np.testing.assert_allclose(got[use] * scale, expected, rtol=1e-9, atol=1e-12)
        assert not np.any(got[~use])


@pytest.mark.parametrize("seed", range(8))
def test_without_bounds_in_reach_the_step_is_that_of_gauss_and_newton(seed):
    residual, jacobian, here = a_pass(seed, 4)
    far = jnp.full(4, 1e9)
    step = step_of(here, jnp.full((1, 4), WEAKEST), -far, far)[0]
    np.testing.assert_allclose(step, np.linalg.lstsq(jacobian, -residual, rcond=None)[0], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_within_a_box_the_model_falls_and_reaches_the_bounded_optimum_in_a_few_steps(seed):
    residual, jacobian, here = a_pass(seed, 4)
    lower, upper = -np.random.default_rng(seed).uniform(0, 0.3, (2, 4)) * [[1.0], [-1.0]]
    expected = lsq_linear(jacobian, -residual, (lower, upper), tol=1e-14).x
    at, cost = jnp.zeros(4), float(here.cost)
    for _ in range(6):
        there = gathered(jnp.asarray(residual) + jnp.asarray(jacobian) @ at, jnp.asarray(jacobian), Squares())
        assert float(there.cost) <= cost * (1 + 1e-12)
        cost = float(there.cost)
        at = at + step_of(there, jnp.full((1, 4), WEAKEST), jnp.asarray(lower) - at, jnp.asarray(upper) - at)[0]
        assert np.all((np.asarray(at) >= lower - 1e-15) & (np.asarray(at) <= upper + 1e-15))
    np.testing.assert_allclose(at, expected, atol=1e-6)


def test_meeting_two_bounds_at_once_never_raises_the_model():
    """Step in a narrow valley in which clipping would raise the model.

    Clipping both parameters to their bounds would end far up the wall of the valley.
    """
    across = np.array([1.1, -2.0])
    normal = np.outer(across, across) + 1e-3 * np.eye(2)
    here = Pass(jnp.asarray(1.0), jnp.asarray(-normal @ [2.0, 1.1]), jnp.asarray(normal))
    step = np.asarray(step_of(here, jnp.full((1, 2), WEAKEST), -jnp.ones(2), jnp.ones(2))[0])
    model = lambda s: float(here.gradient @ s + s @ normal @ s / 2)
    assert model(np.ones(2)) > 0 > model(step)
    assert step[0] == 1.0 and step[1] < 1.0


def test_a_parameter_pressed_outward_stays_and_one_pulled_inward_leaves():
    here = Pass(jnp.asarray(1.0), jnp.asarray([1.0, -1.0]), jnp.eye(2))
    step = step_of(here, jnp.full((1, 2), WEAKEST), jnp.zeros(2), jnp.full(2, 9.0))[0]
    np.testing.assert_allclose(step, [0.0, 1.0], rtol=1e-12)


def drifting(p, args=None):
    """Residuals of a decay with offset and drift."""
    return p[0] * jnp.exp(-p[1] * jnp.asarray(T)) + p[2] + p[3] * jnp.asarray(T) - jnp.asarray(DECAY)


LINEAR = jnp.asarray([False, False, True, True])


@pytest.mark.parametrize("y", [(4.0, 1.5, 0.4, 0.1), (4.0, 1.5, 300.0, -70.0)])
def test_projection_is_the_pass_at_the_conditional_optimum(y):
    passes, y = DensePasses(), jnp.asarray(y)
    found, move, blurred = project(passes(lambda q, args: (drifting(q), None), y, None), LINEAR)
    wave = y[0] * np.exp(-y[1] * T)
    best = np.polynomial.polynomial.polyfit(T, DECAY - wave, 1)
    np.testing.assert_allclose((y + move)[2:], best, rtol=1e-9)
    assert not np.any(np.asarray(move[:2])) and not blurred
    direct = passes(lambda q, args: (drifting(q), None), jnp.asarray([*y[:2], *best]), None)
    np.testing.assert_allclose(found.cost, direct.cost, rtol=1e-8)
    np.testing.assert_allclose(found.gradient, direct.gradient, atol=1e-10 * 300 * T.size)
    np.testing.assert_allclose(found.normal, direct.normal, rtol=1e-12)


@pytest.mark.slow
def test_the_offset_at_the_start_makes_no_difference():
    """Vary the starting offset and drift over many orders of magnitude.

    The number of passes stays the same until the square of the offset uses up half of the digits.
    Then one more pass is needed.
    """
    starts = [(1.0, 1.0, c, d) for c, d in ((0.4, 0.0), (0.0, 0.0), (-1e3, 50.0), (1e7, -1e6))]
    found = [solve(drifting, start, linear=LINEAR) for start in starts]
    joint = solve(drifting, starts[0])
    assert [status(f) for f in found] == [CONVERGED] * 4
    assert [steps(f) - steps(found[0]) for f in found] == [0, 0, 0, 1]
    error = np.sqrt(np.diag(np.linalg.inv(joint.stats["normal"])) * 2 * float(joint.stats["cost"]) / 36)
    for f in found:
        assert np.all(np.abs(np.asarray(f.value - joint.value)) < 5e-3 * error)
        np.testing.assert_allclose(f.stats["cost"], joint.stats["cost"], rtol=1e-6)


@pytest.mark.slow
def test_bounded_coordinates_are_not_projected():
    found = solve(decay, (1.0, 1.0, 0.0), upper=(9.0, 9.0, 0.2), linear=jnp.asarray([False, False, True]))
    plain = solve(decay, (1.0, 1.0, 0.0), upper=(9.0, 9.0, 0.2))
    assert float(found.value[2]) == 0.2
    assert status(found) == status(plain) and steps(found) == steps(plain)


def test_projection_under_another_loss_is_refused():
    start = jnp.asarray([1.0, 1.0, 0.0])
    options = options_for(decay, start, linear=jnp.asarray([False, False, True]))
    solver = LevenbergMarquardt(passes=DensePasses(Huber()))
    with pytest.raises(ValueError, match=r"least squares, but the loss is Huber\. Leave out the option 'linear'"):
        solver.init(lambda q, args: (decay(q), None), start, None, options, None, None, frozenset())


def test_a_step_of_the_solver_calls_no_library():
    fn = lambda q, args: (decay(q), None)
    solver, start = LevenbergMarquardt(), jnp.asarray([1.0, 1.0, 0.0])
    options = options_for(decay, start)
    state = solver.init(fn, start, None, options, None, None, frozenset())
    stepped = jax.jit(lambda y, s: solver.step(fn, y, None, options, s, frozenset())[:2])
    assert "lapack" not in (stepped.lower(start, state).compile().as_text() or "").lower()
