"""Sums of a pass over the data, and robust losses against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from fricjax.estimation.levenberg_marquardt import LevenbergMarquardt
from fricjax.estimation.loss import Cauchy, Huber, SoftL1, Squares
from fricjax.estimation.passes import DensePasses, gather, residual_and_jacobian
from fricjax.estimation.status import CONVERGED
from tests.fitting.problems import T, clean_decay, decay, solve, status, steps
from tests.tiers import cases

LOSSES = {"linear": Squares(), "huber": Huber(1.5), "soft_l1": SoftL1(1.5), "cauchy": Cauchy(1.5)}
AT = jnp.asarray([4.0, 1.2, 0.3])
SIGMA = 0.05
SPIKES = np.where(np.random.default_rng(5).random(T.size) < 0.2, 2.0, 0.0)


def spoilt(p, args=None):
    """Residuals of a decay with one outlier in five samples."""
    noise = SIGMA * np.random.default_rng(6).standard_normal(T.size)
    return (clean_decay(p) - jnp.asarray(noise + SPIKES)) / SIGMA


def with_function(fn):
    return lambda y, args: (fn(y), None)


def test_a_pass_runs_the_model_once_and_sums_up_its_jacobian():
    calls = []
    counted = lambda q: (calls.append(1), decay(q))[1]
    residual, jacobian = residual_and_jacobian(counted, AT)
    assert len(calls) == 1
    there = DensePasses()(with_function(decay), AT, None)
    wave = np.exp(-1.2 * T)
    expected = np.stack([wave, -4.0 * T * wave, np.ones_like(T)], axis=1)
    np.testing.assert_allclose(jacobian, expected, rtol=1e-12)
    np.testing.assert_allclose(there.cost, np.sum(np.asarray(residual) ** 2) / 2, rtol=1e-14)
    np.testing.assert_allclose(there.gradient, expected.T @ np.asarray(residual), rtol=1e-12)
    np.testing.assert_allclose(there.normal, expected.T @ expected, rtol=1e-12)
    assert there.finite


@pytest.mark.parametrize("spoil", ["cost", "gradient", "normal"])
def test_any_part_that_is_not_finite_shows(spoil):
    there = DensePasses()(with_function(decay), AT, None)
    assert not there._replace(**{spoil: getattr(there, spoil) * jnp.nan}).finite


@pytest.mark.parametrize("name", cases(LOSSES, ["huber"]))
def test_sums_of_pieces_are_the_sums_of_the_whole(name):
    residual, jacobian = map(np.asarray, residual_and_jacobian(spoilt, AT))
    gathered = jax.jit(gather)
    whole = gathered(residual, jacobian, LOSSES[name])
    pieces = [gathered(residual[i : i + 8], jacobian[i : i + 8], LOSSES[name]) for i in range(0, T.size, 8)]
    jax.tree.map(lambda a, *b: np.testing.assert_allclose(sum(b), a, rtol=1e-12), whole, *pieces)


@pytest.mark.parametrize("name", cases(LOSSES, ["huber"]))
def test_weight_and_curvature_are_derivatives_of_the_loss(name):
    loss, r = LOSSES[name], jnp.asarray([-9.0, -1.4, -0.3, 0.0, 0.2, 1.1, 1.9, 50.0])
    half = lambda q: loss.parts(q[None])[0][0] / 2
    rho, weight, curvature = loss.parts(r)
    np.testing.assert_allclose(weight * r, jax.vmap(jax.grad(half))(r), rtol=1e-12)
    bend = np.asarray(jax.vmap(jax.grad(jax.grad(half)))(jnp.where(r == 0, 1e-9, r)))
    np.testing.assert_allclose(curvature, np.maximum(bend, 0.1 * np.asarray(weight)), rtol=1e-6)
    assert np.all(np.asarray(rho) <= np.asarray(r) ** 2 * (1 + 1e-12))


@pytest.mark.parametrize("name", cases(LOSSES, ["huber"]))
def test_a_pass_has_the_gradient_of_its_cost(name):
    passes = DensePasses(LOSSES[name])
    cost = lambda y: passes(with_function(spoilt), y, None).cost
    np.testing.assert_allclose(
        passes(with_function(spoilt), AT, None).gradient, jax.grad(cost)(AT), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("name", cases(["huber", "soft_l1", "cauchy"], ["huber"]))
def test_the_robust_optimum_of_scipy(name):
    fn = lambda p: np.asarray(spoilt(jnp.asarray(p)))
    expected = scipy_least_squares(
        fn, (4.0, 1.0, 0.0), "3-point", loss=name, f_scale=1.5, xtol=1e-14, ftol=1e-14, gtol=1e-13, max_nfev=2000
    )
    found = solve(spoilt, (4.0, 1.0, 0.0), solver=LevenbergMarquardt(passes=DensePasses(LOSSES[name])))
    error = np.sqrt(np.diag(np.linalg.inv(np.asarray(found.stats["normal"]))))
    assert status(found) == CONVERGED
    assert steps(found) <= 25
    np.testing.assert_allclose(found.stats["cost"], expected.cost, rtol=1e-6)
    assert np.all(np.abs(np.asarray(found.value) - expected.x) < 5e-3 * error)
    plain = solve(spoilt, (4.0, 1.0, 0.0))
    truth = np.asarray([5.0, 1.7, 0.5])
    assert np.linalg.norm((found.value - truth) / error) < np.linalg.norm((plain.value - truth) / error) / 2
