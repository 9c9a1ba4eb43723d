"""Derivatives of motions under the transformations of JAX."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import AbstractFriction, Coulomb, LuGre, Stribeck, Tanh
from fricjax.oscillator import Oscillator, final_displacement, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.tiers import cases

LAWS: dict[str, Callable[[Any], AbstractFriction]] = {
    "Coulomb": lambda mu: Coulomb(mu, 0.055),
    "Stribeck": lambda mu: Stribeck(mu, 0.065, 5e-3),
    "Tanh": lambda mu: Tanh(mu, 1e-3),
    "LuGre": lambda mu: LuGre(mu, sigma0=1e5, sigma1=200.0),
}
PAIRS = [("Coulomb", "exact")]
TS = jnp.linspace(0.0, 0.3, 13)
X0, STIFFNESS = 2e-3, 2574.0
AT = jnp.asarray([0.05, 1.0, 1.0])
"""Friction coefficient, relative stiffness and relative initial displacement."""


def machine(law: str, mu: Any, stiffness: Any) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, stiffness, PROTOTYPE_DAMPING, 9.66, LAWS[law](mu))


class Problem(eqx.Module):
    """Outputs of a motion as a function of three numbers."""

    law: str = eqx.field(static=True)
    engine: str = eqx.field(static=True)

    def outputs(self, p: Any, ts: Any = TS) -> Any:
        motion = simulate(machine(self.law, p[0], STIFFNESS * p[1]), X0 * p[2], ts, engine=self.engine, accuracy=1e-12)
        stop = jnp.where(jnp.isfinite(motion.t_stop), motion.t_stop, 0.0)
        points = motion.turning_points[:5] / X0
        return jnp.concatenate([motion.x / X0, motion.v, motion.friction_force, points, jnp.reshape(stop, (1,))])

    def total(self, p: Any) -> Any:
        outputs = self.outputs(p)
        return jnp.sin(jnp.arange(outputs.size)) @ outputs

    def rest(self, p: Any) -> Any:
        return final_displacement(machine(self.law, p[0], STIFFNESS * p[1]), X0 * p[2], engine=self.engine) / X0


@pytest.fixture(scope="module", params=cases(PAIRS, PAIRS[:1]), ids=["-".join(pair) for pair in PAIRS])
def problem(request: pytest.FixtureRequest) -> Problem:
    return Problem(*request.param)


@pytest.fixture(scope="module")
def forward(problem: Problem) -> np.ndarray:
    return np.asarray(jax.jacfwd(problem.total)(AT))


def differences(function: Callable, step: float) -> np.ndarray:
    """Fourth-order central differences in each number."""
    columns = []
    for axis in np.eye(AT.size) * step:
        near, far = (np.asarray(function(AT + k * axis)) - np.asarray(function(AT - k * axis)) for k in (1, 2))
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def close(found: Any, expected: Any, rtol: float) -> None:
    scale = np.max(np.abs(expected))
    assert np.all(np.isfinite(found)) and scale > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * scale)


def test_forward_mode_agrees_with_differences(problem: Problem, forward: np.ndarray):
    close(forward, differences(jax.jit(problem.total), 1e-4), 1e-6)


def test_reverse_mode_agrees_with_forward_mode(problem: Problem, forward: np.ndarray):
    close(jax.grad(problem.total)(AT), forward, 1e-9)
    close(jax.jit(jax.grad(problem.total))(AT), forward, 1e-9)


def test_the_jacobian_has_every_output(problem: Problem):
    close(jax.jacrev(problem.outputs)(AT), jax.jacfwd(problem.outputs)(AT), 1e-9)


@pytest.mark.slow
def test_batches_in_both_orders(problem: Problem, forward: np.ndarray):
    batch = jnp.stack([AT, AT * 1.02])
    close(jax.vmap(jax.grad(problem.total))(batch)[0], forward, 1e-9)
    close(jax.grad(lambda batch: jnp.sum(jax.vmap(problem.total)(batch)))(batch)[0], forward, 1e-9)


@pytest.mark.slow
def test_second_derivatives(problem: Problem):
    close(jax.hessian(problem.total)(AT), differences(jax.jit(jax.jacfwd(problem.total)), 1e-4), 1e-4)


@pytest.mark.slow
def test_the_derivative_by_the_times_is_the_velocity(problem: Problem):
    n = TS.size
    by_times = jax.jacrev(lambda ts: problem.outputs(AT, ts)[:n] * X0)(TS)
    close(by_times, np.diag(np.asarray(problem.outputs(AT)[n : 2 * n])), 1e-6)


@pytest.mark.slow
def test_an_oscillator_may_be_differentiated_as_a_whole(problem: Problem):
    whole = machine(problem.law, 0.05, STIFFNESS)

    def last(oscillator: Oscillator) -> Any:
        return simulate(oscillator, X0, TS, engine="auto" if problem.engine == "exact" else problem.engine).x[3] / X0

    gradient = eqx.filter_grad(last)(whole)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(gradient))
    by_mu = jax.jacfwd(lambda p: problem.outputs(p)[3])(AT)[0]
    assert gradient.friction.mu == pytest.approx(float(by_mu), rel=1e-6)


def test_final_displacements_are_differentiated_in_both_modes(problem: Problem):
    if problem.law == "Tanh":
        pytest.skip("no final displacement under a regularised law")
    starts = jnp.stack([AT, AT * jnp.asarray([1.0, 1.0, 1.3])])
    found = jax.vmap(jax.grad(problem.rest))(starts)
    close(found, jax.vmap(jax.jacfwd(problem.rest))(starts), 1e-9)
    close(found[0], differences(jax.jit(problem.rest), 1e-4), 1e-6)
