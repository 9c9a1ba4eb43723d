"""Derivatives across reversals.

A stepping loop with sgn(v) loses the contribution of each reversal. The engines of the package include it.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb
from fricjax.oscillator import Oscillator, simulate
from tests.tiers import cases

OMEGA, FORCE, X0 = 70.71067811865476, 0.981, 3e-3
HALF_PERIODS = np.array([1.5, 3.5, 5.5, 6.5])
PUBLISHED = np.array([1.11, 1.41, 2.24, 3.71])
STEP = 5e-6


def naive(omega: jax.Array, times: np.ndarray) -> jax.Array:
    """Integrate ``-omega^2 x - F sgn(v)`` by RK4 with constant steps."""

    def rate(y: jax.Array) -> jax.Array:
        return jnp.stack([y[1], -(omega**2) * y[0] - FORCE * jnp.sign(y[1])])

    def step(y: jax.Array, _: None) -> tuple[jax.Array, jax.Array]:
        k1 = rate(y)
        k2 = rate(y + STEP / 2 * k1)
        k3 = rate(y + STEP / 2 * k2)
        k4 = rate(y + STEP * k3)
        after = y + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return after, after[0]

    count = round(times[-1] / STEP)
    _, x = jax.lax.scan(step, jnp.asarray([X0, 0.0]), length=count)
    return x[np.round(times / STEP).astype(int) - 1]


def ours(omega: jax.Array | float, times: np.ndarray, engine: str) -> jax.Array:
    return simulate(Oscillator(1.0, omega**2, 0.0, FORCE, Coulomb(1.0)), X0, times, engine=engine).x


@pytest.mark.parametrize("engine", cases(["exact", "hybrid"], ["exact"]))
def test_the_frequency_derivative_is_right_where_the_naive_one_is_not(engine: str):
    times = np.round(HALF_PERIODS * np.pi / OMEGA / STEP) * STEP
    point, one = (jnp.asarray(OMEGA),), (jnp.ones(()),)
    x_naive, slope_naive = jax.jvp(lambda w: naive(w, times), point, one)
    x, slope = jax.jvp(lambda w: ours(w, times, engine), point, one)
    np.testing.assert_allclose(x_naive, x, rtol=0, atol=1e-6)
    np.testing.assert_allclose(slope_naive / slope, PUBLISHED, rtol=0.01)
    h = 1e-4
    difference = (ours(OMEGA + h, times, engine) - ours(OMEGA - h, times, engine)) / (2 * h)
    np.testing.assert_allclose(slope, difference, rtol=1e-6)
