"""Elimination of small systems against dense solutions."""

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.estimation.damped_step import eliminate
from fricjax.oscillator.engines.smooth.rosenbrock import factorise, substitute


def systems(n, seed):
    """Two systems dominated by their diagonals, without symmetry."""
    generator = np.random.default_rng(seed)
    return generator.standard_normal((2, n, n)) + 3 * n * np.eye(n), generator.standard_normal((2, n))


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_scalar_and_array_form_agree_with_dense_solutions(n):
    matrix, right = systems(n, n)
    expected = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    np.testing.assert_allclose(eliminate(jnp.asarray(matrix), jnp.asarray(right)), expected, rtol=1e-11)
    factors = factorise([[jnp.asarray(matrix[:, i, j]) for j in range(n)] for i in range(n)])
    entries = substitute(factors, [jnp.asarray(right[:, i]) for i in range(n)])
    np.testing.assert_allclose(jnp.stack(entries, axis=1), expected, rtol=1e-11)


@pytest.mark.parametrize("weakest", [1e-3, 1e-8, 1e-12])
def test_positive_definite_systems_near_singularity_leave_small_residuals(weakest):
    generator = np.random.default_rng(0)
    basis = np.linalg.qr(generator.standard_normal((6, 6)))[0]
    matrix = (basis * np.geomspace(weakest, 1.0, 6)) @ basis.T
    right = matrix @ generator.standard_normal(6)
    found = np.asarray(eliminate(jnp.asarray(matrix), jnp.asarray(right)))
    assert np.max(np.abs(matrix @ found - right)) < 1e-14 * max(1.0, float(np.max(np.abs(found))))
