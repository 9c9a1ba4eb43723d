"""Rate-and-state friction: direct effect, evolution, ageing, and numbers that would overflow."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import RateState, RateStateSlip
from fricjax.friction.rate_state import arsinh_of_product

LOAD = jnp.asarray(2.0)
KINDS = (RateState, RateStateSlip)


@pytest.mark.parametrize("kind", KINDS)
def test_steady_sliding_is_logarithmic(kind: type):
    law = kind(0.3, 0.01, 0.015, 1e-5)
    for v in (1e-7, 1e-6, 1e-2):
        expected = 2.0 * (0.3 + (0.01 - 0.015) * np.log(v / 1e-6))
        assert float(law.sliding_force(jnp.asarray(v), LOAD)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_leap_of_velocity_shows_the_direct_effect(kind: type):
    law = kind(0.3, 0.01, 0.015, 1e-5)
    state = law.steady_state(jnp.asarray(1e-4), jnp.asarray(1.0), LOAD)
    before, after = (float(law.force(jnp.asarray(v), state, LOAD)) for v in (1e-4, 1e-3))
    assert after - before == pytest.approx(2.0 * 0.01 * np.log(10), rel=1e-9)


def test_evolution_over_a_slip():
    # psi tends to -ln(v/v0), exponentially over D_c under the slip law. Under the ageing law, theta = D_c/v does.
    slip, ageing = (kind(0.3, 0.01, 0.015, 1e-5) for kind in (RateStateSlip, RateState))
    v, state = jnp.asarray(1e-3), jnp.asarray([0.4e-5])
    assert float(slip.rate(v, state, LOAD)[0]) == pytest.approx(-1e-3 * (np.log(1e3) + 0.4), rel=1e-12)
    theta = 1e-5 / 1e-6 * np.exp(0.4)
    assert float(ageing.rate(v, state, LOAD)[0]) == pytest.approx(1e-5 * (1 - 1e-3 * theta / 1e-5) / theta, rel=1e-12)


def test_only_the_ageing_law_strengthens_at_rest():
    state = jnp.asarray([0.4e-5])
    assert float(RateState(0.3, 0.01, 0.015, 1e-5).rate(jnp.zeros(()), state, LOAD)[0]) == pytest.approx(
        1e-6 * np.exp(-0.4)
    )
    assert float(RateStateSlip(0.3, 0.01, 0.015, 1e-5).rate(jnp.zeros(()), state, LOAD)[0]) == 0.0


def test_a_slow_pull_is_one_at_the_reference_velocity():
    law = RateState(0.3, 0.01, 0.015, 1e-5)
    np.testing.assert_array_equal(law.pulled_state(jnp.asarray(1.0), LOAD), [0.0])
    pulled = law.force(law.v_reference, law.pulled_state(jnp.asarray(1.0), LOAD), LOAD)
    assert float(pulled) == pytest.approx(float(law.static_force(LOAD)), rel=1e-9)


def test_arsinh_of_a_product():
    ratio = np.array([-1e3, -1e-3, -1e-300, 0.0, 1e-12, 0.4, 7.0])
    for exponent in (-5.0, 0.0, 3.0, 30.0):
        found = arsinh_of_product(jnp.asarray(ratio), jnp.asarray(exponent))
        np.testing.assert_allclose(found, np.arcsinh(ratio * np.exp(exponent)), rtol=1e-13)
    # ln(2 x) where the product overflows.
    beyond = arsinh_of_product(jnp.asarray(ratio[ratio != 0]), jnp.asarray(1200.0))
    x = ratio[ratio != 0]
    np.testing.assert_allclose(beyond, np.sign(x) * (np.log(2 * np.abs(x)) + 1200), rtol=1e-13)
    slopes = jax.vmap(jax.grad(arsinh_of_product, argnums=(0, 1)), in_axes=(0, None))(
        jnp.asarray([-1e-3, 0.0, 0.5]), jnp.asarray(1200.0)
    )
    assert np.all(np.isfinite(slopes))
    np.testing.assert_allclose(slopes[0][2], 2.0, rtol=1e-12)
