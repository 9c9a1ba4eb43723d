"""Derivatives of motions under the transformations of JAX."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb
from fricjax.oscillator import Oscillator, final_displacement, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS, central_differences

TS = jnp.linspace(0.0, 0.3, 13)
X0, STIFFNESS = 2e-3, 2574.0
AT = jnp.asarray([0.05, 1.0, 1.0])
"""Friction coefficient, relative stiffness and relative initial displacement."""


def machine(mu: Any, stiffness: Any) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, stiffness, PROTOTYPE_DAMPING, 9.66, Coulomb(mu, 0.055))


def outputs(p: Any, ts: Any = TS) -> Any:
    """All outputs of a motion as a function of three numbers."""
    motion = simulate(machine(p[0], STIFFNESS * p[1]), X0 * p[2], ts, engine="exact")
    points, stop = motion.turning_points[:5] / X0, jnp.reshape(motion.t_stop, (1,))
    return jnp.concatenate([motion.x / X0, motion.v, motion.friction_force, points, stop])


def total(p: Any) -> Any:
    values = outputs(p)
    return jnp.sin(jnp.arange(values.size)) @ values


def rest(p: Any) -> Any:
    return final_displacement(machine(p[0], STIFFNESS * p[1]), X0 * p[2], engine="exact") / X0


@pytest.fixture(scope="module")
def forward() -> np.ndarray:
    return np.asarray(jax.jacfwd(total)(AT))


def close(found: Any, expected: Any, rtol: float) -> None:
    scale = np.max(np.abs(expected))
    assert np.all(np.isfinite(found)) and scale > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * scale)


def test_forward_mode_agrees_with_differences(forward: np.ndarray):
    close(forward, central_differences(jax.jit(total), AT, 1e-4)[0], 1e-6)


def test_reverse_mode_agrees_with_forward_mode(forward: np.ndarray):
    close(jax.grad(total)(AT), forward, 1e-9)
    close(jax.jit(jax.grad(total))(AT), forward, 1e-9)


def test_the_jacobian_has_every_output():
    close(jax.jacrev(outputs)(AT), jax.jacfwd(outputs)(AT), 1e-9)


@pytest.mark.slow
def test_batches_in_both_orders(forward: np.ndarray):
    batch = jnp.stack([AT, AT * 1.02])
    close(jax.vmap(jax.grad(total))(batch)[0], forward, 1e-9)
    close(jax.grad(lambda batch: jnp.sum(jax.vmap(total)(batch)))(batch)[0], forward, 1e-9)


@pytest.mark.slow
def test_second_derivatives():
    close(jax.hessian(total)(AT), central_differences(jax.jit(jax.jacfwd(total)), AT, 1e-4)[0], 1e-4)


@pytest.mark.slow
def test_the_derivative_by_the_times_is_the_velocity():
    n = TS.size
    by_times = jax.jacrev(lambda ts: outputs(AT, ts)[:n] * X0)(TS)
    close(by_times, np.diag(np.asarray(outputs(AT)[n : 2 * n])), 1e-6)


@pytest.mark.slow
def test_an_oscillator_may_be_differentiated_as_a_whole():
    whole = machine(0.05, STIFFNESS)

    def last(oscillator: Oscillator) -> Any:
        return simulate(oscillator, X0, TS).x[3] / X0

    gradient = eqx.filter_grad(last)(whole)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))
    by_mu = jax.jacfwd(lambda p: outputs(p)[3])(AT)[0]
    assert gradient.friction.mu == pytest.approx(float(by_mu), rel=1e-6)


def test_final_displacements_are_differentiated_in_both_modes():
    starts = jnp.stack([AT, AT * jnp.asarray([1.0, 1.0, 1.3])])
    found = jax.vmap(jax.grad(rest))(starts)
    close(found, jax.vmap(jax.jacfwd(rest))(starts), 1e-9)
    close(found[0], central_differences(jax.jit(rest), AT, 1e-4)[0], 1e-6)
