"""Properties of every friction law."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fricjax.friction as friction
from fricjax.friction import AbstractFriction, Coulomb, LuGre, QuadraticDrag, Stribeck, Tanh
from fricjax.friction.base import Scalar, scalar
from fricjax.oscillator import restoring
from tests.cases.case import LOAD
from tests.helpers import EXPORTED_LAWS, LAWS
from tests.tiers import cases

SPEEDS = np.geomspace(1e-7, 1.0, 40)
LOAD_ARRAY = jnp.asarray(LOAD)


def steady_force(law: AbstractFriction, speed: jax.Array, direction: float) -> jax.Array:
    state = law.steady_state(speed, jnp.asarray(direction), LOAD_ARRAY)
    return law.force(direction * speed, state, LOAD_ARRAY)


CORE = ("Coulomb", "Stribeck", "Tanh", "Spline", "Dahl", "LuGre", "MaxwellSlip", "RateState")


@pytest.fixture(params=cases(LAWS, CORE), scope="module")
def case(request: pytest.FixtureRequest):
    return LAWS[request.param]


def test_every_exported_law_has_a_case():
    assert set(EXPORTED_LAWS.values()) == {type(case.law) for case in LAWS.values()}


def test_steady_sliding_force_is_the_force_in_the_steady_state(case):
    forces = jax.vmap(lambda u: steady_force(case.law, u, 1.0))(jnp.asarray(SPEEDS))
    sliding = jax.vmap(lambda u: case.law.sliding_force(u, LOAD_ARRAY))(jnp.asarray(SPEEDS))
    np.testing.assert_allclose(forces, sliding, rtol=1e-12)


def test_the_force_is_odd_in_velocity(case):
    forwards = jax.vmap(lambda u: steady_force(case.law, u, 1.0))(jnp.asarray(SPEEDS))
    backwards = jax.vmap(lambda u: steady_force(case.law, u, -1.0))(jnp.asarray(SPEEDS))
    np.testing.assert_allclose(forwards, -backwards, rtol=1e-14)


def test_modes_are_the_last_states_and_have_no_rate(case):
    law, random = case.law, np.random.default_rng(1)
    for speed in (-0.1, 1e-4):
        state = law.state_scale(LOAD_ARRAY) * random.uniform(-1, 1, law.n_states)
        rate = np.asarray(law.rate(jnp.asarray(speed), state, LOAD_ARRAY))
        moving = law.n_states - law.n_modes
        assert np.all(rate[:moving] != 0) and np.all(rate[moving:] == 0)
        found = law.force_of(jnp.asarray(speed), state, rate, LOAD_ARRAY)
        np.testing.assert_allclose(found, law.force(jnp.asarray(speed), state, LOAD_ARRAY), rtol=1e-14)


def test_states_stand_still_in_the_steady_state_and_follow_a_mirrored_motion(case):
    n = case.law.n_states
    for speed in (1e-4, 0.1):
        state = case.law.steady_state(jnp.asarray(speed), jnp.asarray(1.0), LOAD_ARRAY)
        rate = case.law.rate(jnp.asarray(speed), state, LOAD_ARRAY)
        assert state.shape == rate.shape == case.law.state_scale(LOAD_ARRAY).shape == (n,)
        # Slipping elements are integrated as if they stuck. The return map then corrects their states.
        v, a = jnp.asarray(speed), jnp.zeros(())
        now, later = (case.law.return_map(v, a, z, LOAD_ARRAY) for z in (state, state + rate))
        np.testing.assert_allclose(later - now, 0.0, atol=1e-12 * speed)
        mirrored = case.law.rate(jnp.asarray(-speed), case.parity * state, LOAD_ARRAY)
        np.testing.assert_array_equal(mirrored, case.parity * rate)


def test_static_and_dynamic_forces(case):
    assert case.law.static_force(LOAD_ARRAY) == pytest.approx(case.static)
    assert case.law.dynamic_force(LOAD_ARRAY) == pytest.approx(case.kinetic)


def test_coefficients_are_leaves_with_units(case):
    laws = case.law.laws if isinstance(case.law, friction.Sum) else (case.law,)
    for law in laws:
        names = {path[0].name for path, _ in jax.tree_util.tree_leaves_with_path(law)}
        assert names <= set(law.coefficients)
        assert all(leaf.dtype == np.float64 and leaf.shape == () for leaf in jax.tree.leaves(law))


def test_a_law_of_ones_own_must_describe_its_coefficients():
    class Sticky(Coulomb):
        glue: Scalar = eqx.field(converter=scalar, default=0.0)

    with pytest.raises(TypeError, match=r"Sticky does not describe its coefficient glue: add Coefficient\("):
        Sticky(0.1, None, 2.0)

    class Heavy(restoring.Linear):
        added: Scalar = eqx.field(converter=scalar, default=0.0)

    with pytest.raises(TypeError, match="Heavy does not describe its coefficient added"):
        Heavy(1.0)


def test_derivatives_of_the_force_are_finite_from_rest_to_any_speed(case):
    leaves, structure = jax.tree.flatten(case.law)

    def force(values, speed):
        return steady_force(jax.tree.unflatten(structure, values), speed, 1.0)

    for speed in (0.0, 1e-300, 1e-3, 10.0, 1e6):
        slopes = jax.jacfwd(force)([jnp.asarray(leaf) for leaf in leaves], jnp.asarray(speed))
        assert np.all(np.isfinite(slopes)), speed


@pytest.mark.parametrize("law", [Coulomb(0.1, 0.15), Stribeck(0.1, 0.15), LuGre(0.1), QuadraticDrag(0.1)])
def test_a_law_without_a_jump_to_sharpen_is_its_own_sharp_law(law):
    assert law.set_valued_limit() is law


def test_tanh_tends_to_its_sharp_law():
    v = jnp.asarray([-1e-3, -1e-5, 1e-5, 1e-3])
    sharp = Tanh(0.1, 1e-9).set_valued_limit()
    assert isinstance(sharp, Coulomb)
    smooth = Tanh(0.1, 1e-9).force(v, jnp.zeros(0), LOAD_ARRAY)
    np.testing.assert_allclose(smooth, sharp.force(v, jnp.zeros(0), LOAD_ARRAY), rtol=1e-14)


def test_stribeck_without_a_static_coefficient_is_coulomb():
    v = jnp.asarray([-0.1, -1e-4, 0.0, 1e-4, 0.1])
    stribeck, coulomb = (
        law.force(v, jnp.zeros(0), LOAD_ARRAY) for law in (Stribeck(0.1, v_stribeck=1e-3), Coulomb(0.1))
    )
    np.testing.assert_array_equal(stribeck, coulomb)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_stribeck_falls_as_published(exponent):
    speed = np.array([1e-5, 1e-3, 5e-3, 2e-2])
    expected = LOAD * (0.1 + 0.05 * np.exp(-((speed / 5e-3) ** exponent)))
    law = Stribeck(0.1, 0.15, 5e-3, exponent)
    np.testing.assert_allclose(law.sliding_force(jnp.asarray(speed), LOAD_ARRAY), expected, rtol=1e-14)
    assert law.sliding_force(jnp.zeros(()), LOAD_ARRAY) == law.static_force(LOAD_ARRAY)


def test_a_static_coefficient_below_the_dynamic_one_holds_no_less_than_sliding_friction():
    law = eqx.tree_at(lambda law: law.mu, Coulomb(0.01, 0.02), jnp.asarray(0.1))
    assert law.static_force(LOAD_ARRAY) == pytest.approx(0.1 * LOAD)


def test_a_tied_static_coefficient_follows_mu():
    for build in (Coulomb, Stribeck, LuGre):
        slope = jax.jacfwd(lambda mu, build=build: build(mu).static_force(LOAD_ARRAY))(jnp.asarray(0.1))
        assert slope == pytest.approx(LOAD)


@pytest.mark.parametrize(
    ("law", "scale"),
    [
        (Coulomb(0.1, 0.15), np.inf),
        (QuadraticDrag(0.5), np.inf),
        (Stribeck(0.1, 0.15, 5e-3), 5e-3),
        (Tanh(0.1, 1e-3), 1e-3),
        (LuGre(0.1), np.inf),
        (LuGre(0.1, 0.15, 5e-3), 5e-3),
        (QuadraticDrag(0.5) + Tanh(0.1, 1e-3) + Tanh(0.1, 1e-4), 1e-4),
    ],
)
def test_velocity_scale(law: AbstractFriction, scale: float):
    assert law.velocity_scale() == scale


@pytest.mark.parametrize("law", [Tanh(0.1, 1e-3), Stribeck(0.1, 0.15, 5e-3), Stribeck(0.1, 0.15, 5e-3, 1.0)])
def test_most_of_the_change_of_a_force_lies_within_a_few_velocity_scales(law: AbstractFriction):
    scale = float(law.velocity_scale())
    rest, near, far = (float(law.sliding_force(jnp.asarray(n * scale), LOAD_ARRAY)) for n in (0.0, 3.0, 1e3))
    assert abs(near - far) < 0.06 * abs(rest - far)
