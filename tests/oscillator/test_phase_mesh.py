"""Mesh of a half-cycle in phase: ends, symmetry and small steps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.oscillator.engines.hybrid.phase_steps import mesh_fractions

LAYERS = [np.inf, 10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9]


@pytest.mark.parametrize("skew", [0.0, 0.2])
@pytest.mark.parametrize("layer", LAYERS)
@pytest.mark.parametrize("steps", [2, 16, 28, 64])
def test_a_mesh_rises_from_end_to_end_and_is_symmetric(steps: int, layer: float, skew: float):
    fractions = np.asarray(mesh_fractions(steps, jnp.asarray(layer), skew))
    assert fractions.shape == (steps + 1,)
    assert fractions[0] == 0 and fractions[-1] == 1
    assert np.all(np.diff(fractions) > 0)
    np.testing.assert_allclose(fractions + fractions[::-1], 1.0, atol=1e-15)


@pytest.mark.parametrize("layer", [0.1, 1e-3, 1e-6])
def test_the_layer_is_resolved_and_the_middle_is_even(layer: float):
    theta = np.pi * np.asarray(mesh_fractions(32, jnp.asarray(layer)))
    steps = np.diff(theta)[:16]
    # The points are equidistant in the sum of a logarithm and a straight line, so each term bounds the steps.
    span = np.log1p(np.pi / 2 / layer)
    rank = 0.6 * np.log1p(theta[:17] / layer) / span + 0.4 * theta[:17] / (np.pi / 2)
    np.testing.assert_allclose(np.diff(rank), 1 / 16, rtol=1e-9)
    assert steps[0] < layer * np.expm1(span / 16 / 0.6)
    assert np.all(steps < np.pi / 2 / 16 / 0.4)


def test_a_skewed_mesh_is_denser_at_the_reversals_and_less_dense_between_them():
    even, skewed = (np.diff(mesh_fractions(64, jnp.asarray(np.inf), skew))[:32] for skew in (0.0, 0.2))
    assert (skewed / even)[[0, -1]] == pytest.approx([0.8, 1.2], abs=2e-3)
    assert np.all(np.diff(skewed) > 0)


def test_without_a_layer_the_steps_are_even():
    np.testing.assert_allclose(np.diff(mesh_fractions(20, jnp.asarray(np.inf))), 0.05, rtol=1e-3)


def test_the_mesh_has_no_derivatives():
    slope = jax.jacfwd(lambda layer: mesh_fractions(16, layer))(jnp.asarray(1e-3))
    np.testing.assert_array_equal(slope, 0.0)
