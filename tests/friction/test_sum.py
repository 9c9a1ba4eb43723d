"""Laws that act together."""

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Stribeck, Sum, Tanh

LOAD = jnp.asarray(2.0)
V = jnp.asarray(0.03)
NO_STATE = jnp.zeros(0)


def test_forces_add():
    parts = Coulomb(0.1), QuadraticDrag(0.5), Stribeck(0.02, 0.03, 0.01)
    total = sum(float(law.force(V, NO_STATE, LOAD)) for law in parts)
    law = parts[0] + parts[1] + parts[2]
    assert law.force(V, NO_STATE, LOAD) == pytest.approx(total, rel=1e-15)
    assert law.sliding_force(V, LOAD) == pytest.approx(total, rel=1e-15)
    assert law.static_force(LOAD) == pytest.approx(2 * (0.1 + 0.03))
    assert law.dynamic_force(LOAD) == pytest.approx(2 * (0.1 + 0.02))


def test_sums_are_flat():
    law = (Coulomb(0.1) + QuadraticDrag(0.5)) + (Coulomb(0.2) + QuadraticDrag(0.1))
    assert isinstance(law, Sum)
    assert [type(part) for part in law.laws] == [Coulomb, QuadraticDrag, Coulomb, QuadraticDrag]


def test_internal_states_keep_to_their_law():
    first, second = LuGre(0.1, sigma0=1e4), LuGre(0.2, sigma0=1e5)
    law = first + Tanh(0.1, 1e-3) + second
    state = jnp.asarray([1e-5, -2e-6])
    assert law.n_states == 2
    expected = jnp.concatenate([first.rate(V, state[:1], LOAD), second.rate(V, state[1:], LOAD)])
    np.testing.assert_array_equal(law.rate(V, state, LOAD), expected)
    forces = first.force(V, state[:1], LOAD) + Tanh(0.1, 1e-3).force(V, NO_STATE, LOAD)
    assert law.force(V, state, LOAD) == pytest.approx(float(forces + second.force(V, state[1:], LOAD)), rel=1e-15)


def test_a_jump_and_a_bristle_do_not_go_together():
    with pytest.raises(ValueError, match=r"Coulomb \+ LuGre adds a set-valued law to one with internal states"):
        _ = Coulomb(0.1) + LuGre(0.1)


def test_the_sharp_sum_sharpens_each_part():
    law = (Tanh(0.1, 1e-4) + QuadraticDrag(0.5)).set_valued_limit()
    assert isinstance(law, Sum)
    assert [type(part) for part in law.laws] == [Coulomb, QuadraticDrag]
    assert law.set_valued


def test_a_sum_with_memory_has_no_sharp_twin():
    law = Tanh(0.1, 1e-4) + LuGre(0.1)
    assert law.set_valued_limit() is law
