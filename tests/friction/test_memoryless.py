"""Laws without memory against published formulas, and their error messages."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import (
    Ageing,
    Coulomb,
    LoadDependent,
    Lorentzian,
    Makkar,
    MonotoneSpline,
    QuadraticDrag,
    Spline,
    Stribeck,
    Sum,
    Tanh,
    Viscous,
)

LOAD = 2.0
SPEED = np.array([0.0, 1e-5, 1e-3, 5e-3, 2e-2, 0.3])
MAKKAR = Makkar(0.05, 2e3, 1e2, 0.1, 1e3, 0.5)


def sliding(law, speed=SPEED, load=LOAD) -> np.ndarray:
    return np.asarray(law.sliding_force(jnp.asarray(speed), jnp.asarray(load)))


def test_coulomb_viscous_is_a_sum():
    law = Coulomb(0.01) + Viscous(2.0)
    assert isinstance(law, Sum)
    np.testing.assert_allclose(sliding(law), 0.01 * LOAD + 2.0 * SPEED, rtol=1e-15)
    np.testing.assert_allclose(sliding(law.set_valued_limit()), sliding(law), rtol=1e-15)


def test_a_viscous_force_asks_for_no_implicit_steps():
    assert not Viscous(2.0).stiff
    assert (Tanh(0.1, 1e-4) + Viscous(2.0)).stiff


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_the_lorentzian_falls_as_published(exponent):
    expected = LOAD * (0.1 + 0.05 / (1 + (SPEED / 5e-3) ** exponent))
    np.testing.assert_allclose(sliding(Lorentzian(0.1, 0.15, 5e-3, exponent)), expected, rtol=1e-14)


def test_a_lorentzian_without_a_static_coefficient_is_coulomb():
    np.testing.assert_array_equal(sliding(Lorentzian(0.1)), sliding(Coulomb(0.1)))


def test_makkar_is_the_published_law_with_its_forces_per_load():
    g1, g2, g3, g4, g5, g6 = 0.1, 2e3, 1e2, 0.2, 1e3, 0.5  # the first and the fourth in N
    v = np.concatenate([-SPEED, SPEED])
    expected = g1 * (np.tanh(g2 * v) - np.tanh(g3 * v)) + g4 * np.tanh(g5 * v) + g6 * v
    np.testing.assert_allclose(MAKKAR.force(jnp.asarray(v), jnp.zeros(0), jnp.asarray(LOAD)), expected, rtol=1e-14)


def test_makkar_tends_to_its_sharp_law():
    steep = Makkar(0.05, 1e9, 1e2, 0.1, 1e9, 0.5)
    sharp = steep.set_valued_limit()
    assert sharp.set_valued
    np.testing.assert_allclose(sliding(steep, SPEED[1:]), sliding(sharp, SPEED[1:]), rtol=1e-14)
    load = jnp.asarray(LOAD)
    assert sharp.static_force(load) == pytest.approx(sliding(sharp)[0]) == pytest.approx(0.15 * LOAD)
    assert sharp.dynamic_force(load) == steep.dynamic_force(load)


@pytest.mark.parametrize("load", [0.5, 2.0, 30.0])
def test_friction_grows_with_a_power_of_the_load(load):
    law = LoadDependent(0.1, 2 / 3, 5.0, 0.03)
    np.testing.assert_allclose(sliding(law, load=load), 0.1 * (load / 5.0) ** (-1 / 3) * load + 0.03, rtol=1e-14)


def test_one_load_tells_no_more_than_one_force():
    assert sliding(LoadDependent(0.1, 0.7, LOAD)) == pytest.approx(sliding(Coulomb(0.1)))


def test_a_contact_ages_with_the_logarithm_of_the_dwell_time():
    load = jnp.asarray(LOAD)
    for dwell in (0.0, 1.0, 100.0):
        law = Ageing(0.1, 0.01, dwell, 0.12, 2.0)
        assert law.breakaway_force(load) == pytest.approx((0.12 + 0.01 * np.log(1 + dwell / 2.0)) * LOAD)
        assert law.static_force(load) == pytest.approx(0.12 * LOAD)


def test_no_other_law_ages():
    load = jnp.asarray(LOAD)
    for law in (Coulomb(0.1, 0.15), Stribeck(0.1, 0.15), Tanh(0.1, 1e-3)):
        assert law.breakaway_force(load) == law.static_force(load)
    aged = Ageing(0.1, 0.01, 60.0) + Coulomb(0.1, 0.15)
    assert aged.breakaway_force(load) == pytest.approx((0.1 + 0.01 * np.log(61) + 0.15) * LOAD)


@pytest.mark.parametrize(
    ("law", "scale"), [(MAKKAR, 1 / 2e3), (MAKKAR.set_valued_limit(), 1e-2), (Viscous(1.0), np.inf)]
)
def test_velocity_scale(law, scale):
    assert law.velocity_scale() == scale


def test_a_tied_static_coefficient_follows_mu():
    for build in (Lorentzian, lambda mu: Ageing(mu, 0.01, 0.0)):
        slope = jax.jacfwd(lambda mu, build=build: build(mu).static_force(jnp.asarray(LOAD)))(jnp.asarray(0.1))
        assert slope == pytest.approx(LOAD)


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: Viscous(np.nan), r"sigma2 of Viscous must be a number of N s/m, got nan N s/m\."),
        (lambda: QuadraticDrag("much"), "A coefficient must be a number in SI units, got the text 'much'"),
        (lambda: Lorentzian(-0.1), r"mu of Lorentzian must not be negative, got -0\.1\."),
        (lambda: Lorentzian(0.1, 0.05), r"mu_s of Lorentzian must be at least mu = 0\.1, got 0\.05\."),
        (lambda: Lorentzian(0.1, 0.2, 0.0), r"v_stribeck of Lorentzian must be a positive number of m/s, got 0\.0\."),
        (lambda: Lorentzian(0.1, 0.2, 1.0, -2.0), r"exponent of Lorentzian must be a positive number, got -2\.0\."),
        (lambda: Makkar(-1.0, 2.0, 1.0, 1.0, 1.0), r"gamma1 of Makkar must not be negative, got -1\.0\."),
        (lambda: Makkar(1.0, 1.0, 1.0, 1.0, 1.0), r"gamma2 of Makkar must be above gamma3 = 1\.0, got 1\.0\."),
        (lambda: Makkar(1.0, 2.0, 0.0, 1.0, 1.0), r"gamma3 of Makkar must be a positive number of s/m, got 0\.0\."),
        (lambda: Makkar(1.0, 2.0, 1.0, -1.0, 1.0), r"gamma4 of Makkar must not be negative, got -1\.0\."),
        (lambda: Makkar(1.0, 2.0, 1.0, 1.0, -1.0), r"gamma5 of Makkar must be a positive number of s/m, got -1\.0\."),
        (lambda: LoadDependent(-0.1), r"mu of LoadDependent must not be negative, got -0\.1\."),
        (lambda: LoadDependent(0.1, 0.0), r"exponent of LoadDependent must be a positive number, got 0\.0\."),
        (lambda: LoadDependent(0.1, 1.0, 0.0), r"reference_load of LoadDependent must be a positive number of N, got"),
        (lambda: LoadDependent(0.1, adhesion=-1), r"adhesion of LoadDependent must not be negative, got -1\.0 N\."),
        (lambda: Ageing(0.1, -0.01, 1.0), r"beta of Ageing must not be negative, got -0\.01\."),
        (lambda: Ageing(0.1, 0.01, -1.0), r"dwell of Ageing must not be negative, got -1\.0 s\."),
        (lambda: Ageing(0.1, 0.01, 1.0, 0.05), r"mu_s of Ageing must be at least mu = 0\.1, got 0\.05\."),
        (lambda: Ageing(0.1, 0.01, 1.0, None, 0.0), r"dwell_scale of Ageing must be a positive number of s, got 0\.0"),
        (lambda: Spline((0, 1e-3), (0.1, -0.1)), r"forces_1 of Spline must not be negative, got -0\.1\."),
        (
            lambda: Spline((1e-3, 1e-2), (0.1, 0.1)),
            r"knots of Spline must be at least two speeds in m/s that increase ",
        ),
        (lambda: Spline((0, 1e-2, 1e-2), (0.1, 0.1, 0.1)), r"increase from 0, got \(0\.0, 0\.01, 0\.01\)\."),
        (lambda: MonotoneSpline((0,), (0.1,)), r"knots of MonotoneSpline must be at least two"),
        (lambda: MonotoneSpline((0, np.inf), (0.1, 0.1)), r"increase from 0, got \(0\.0, inf\)\."),
        (lambda: Spline((0, 1e-3), (0.1,)), r"forces of Spline must be one coefficient for each of its 2 knots, got 1"),
    ],
)
def test_coefficients_outside_of_their_bounds_get_a_sentence(build, says):
    with pytest.raises(ValueError, match=says):
        build()
