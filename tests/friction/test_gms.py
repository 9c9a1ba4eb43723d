"""The generalised Maxwell-slip model against event-driven integrations and its limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.laws.scipy_slip import GMSContact, event_driven, maxwell_slip
from fricjax.friction import GeneralisedMaxwellSlip
from fricjax.oscillator import Oscillator, simulate
from tests.oracles import coulomb_viscous

M, K, C, N = 0.41068, 2574.0, 0.17557, 9.66
RIG = {"mass": M, "stiffness": K, "damping": C}
TS = np.linspace(0, 0.1, 201)
STIFFNESSES, SHARES = np.array([6e4, 3e4, 1e4]), np.array([0.3, 0.3, 0.4])
VALUES = {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 2e-2, "attraction": 100.0}
LOAD, REST = jnp.asarray(2.0), jnp.zeros(())


def motion(mu, mu_s, v_stribeck, attraction, factor=1.0):
    law = GeneralisedMaxwellSlip(mu, mu_s, v_stribeck, tuple(factor * STIFFNESSES), tuple(SHARES[:-1]), attraction)
    return simulate(Oscillator(M, K, C, N, law), 2e-3, TS).x


def reference(mu, mu_s, v_stribeck, attraction, rtol=1e-12):
    contact = GMSContact(
        2e-3, **RIG, kinetic=mu * N, static=mu_s * N, v_stribeck=v_stribeck, stiffnesses=STIFFNESSES, shares=SHARES,
        attraction=attraction,
    )  # fmt: skip
    return event_driven(TS, contact.start, contact, rtol)


@pytest.mark.slow
@pytest.mark.parametrize("attraction", [10.0, 1000.0])
def test_motion_below_a_tenth_of_a_nanometre(attraction: float):
    values = {**VALUES, "attraction": attraction}
    np.testing.assert_allclose(motion(**values), reference(**values), rtol=0, atol=2e-11)


@pytest.mark.slow
def test_without_a_stribeck_effect_the_elements_are_those_of_maxwell():
    values = {**VALUES, "mu_s": VALUES["mu"]}
    expected = maxwell_slip(TS, 2e-3, **RIG, stiffnesses=STIFFNESSES, forces=SHARES * VALUES["mu"] * N)
    np.testing.assert_allclose(motion(**values), expected, rtol=0, atol=2e-11)


@pytest.mark.slow
def test_stiff_elements_are_coulomb_friction():
    band, omega = 0.05 * N / K, np.sqrt(K / M)
    sharp = coulomb_viscous(
        TS, 2e-3, frequency=float(omega) / (2 * np.pi), zeta=float(C / (2 * M * omega)), dead_band=band
    ).x
    # Each reversal returns an energy proportional to the deflection, and shifts the time by its square root.
    sharp_mu = {**VALUES, "mu_s": VALUES["mu"]}
    mild, stiff = (np.max(np.abs(motion(**sharp_mu, factor=s) - sharp)) for s in (1e2, 1e4))
    assert stiff < 1e-6
    assert mild / stiff == pytest.approx(10.0, rel=0.1)


@pytest.mark.slow
def test_derivatives_agree_with_differences_of_the_event_driven_motion():
    values, direction = np.array(list(VALUES.values())), np.array([1.0, 0.7, -0.5, 0.3])
    at = lambda h: dict(zip(VALUES, values * (1 + h * direction), strict=True))
    _, slope = jax.jvp(lambda h: motion(**at(h)), (jnp.zeros(()),), (jnp.ones(()),))
    difference = (reference(**at(1e-4)) - reference(**at(-1e-4))) / 2e-4
    assert np.linalg.norm(slope - difference) < 1e-5 * np.linalg.norm(difference)


def law() -> GeneralisedMaxwellSlip:
    return GeneralisedMaxwellSlip(0.1, 0.15, 1e-2, (1e4, 2e4), (0.4,), 5.0)


def test_slipping_elements_are_attracted_by_their_share_of_the_steady_force():
    # At constant speed the force tends to a_i g(v) with the time constant g/C.
    contact, v = law(), jnp.asarray(-0.02)
    capacity = float(contact.limit(jnp.asarray(0.02), LOAD))
    steady = contact.steady_state(v, jnp.asarray(-1.0), LOAD)
    off = jnp.asarray([2e-6, -1e-6, 0.0, 0.0])
    expected = jnp.append(-5.0 / capacity * off[:2], jnp.zeros(2))
    np.testing.assert_allclose(contact.rate(v, steady + off, LOAD), expected, rtol=1e-9, atol=1e-15)


def test_elements_slip_with_their_share_and_stick_together_when_the_velocity_changes_its_sign():
    contact, v = law(), jnp.asarray(1e-3)
    share = np.array([0.4, 0.6]) * float(contact.limit(v, LOAD)) / np.array([1e4, 2e4])
    pulled = jnp.asarray([1.5 * share[0], 0.5 * share[1], 0.0, 0.0])
    state = contact.return_map(v, REST, pulled, LOAD)
    np.testing.assert_allclose(state, [share[0], 0.5 * share[1], share[0], 0.0], rtol=1e-12)
    # The force does not change with the mode, because the overshoot does not contribute to it.
    np.testing.assert_allclose(contact.force(v, pulled, LOAD), contact.force(v, state, LOAD), rtol=1e-12)
    slower = contact.return_map(v / 2, REST, state, LOAD)
    np.testing.assert_array_equal(slower, state)
    assert contact.rate(v / 2, slower, LOAD)[0] != v / 2
    reversed_ = contact.return_map(-v, REST, slower, LOAD)
    np.testing.assert_array_equal(reversed_[2:], 0.0)
    np.testing.assert_array_equal(contact.rate(-v, reversed_, LOAD)[:2], -v)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: GeneralisedMaxwellSlip(0.1, stiffnesses=(1e4, 1e4)), "a share for each but the last"),
        (lambda: GeneralisedMaxwellSlip(0.1, stiffnesses=()), "got 0 stiffnesses and 0 shares"),
        (
            lambda: GeneralisedMaxwellSlip(0.1, stiffnesses=(1e4, 1e4, 1e4), shares=(0.5, 0.5)),
            "shares of GeneralisedMaxwellSlip must leave something to the last element, got a sum of 1.0.",
        ),
        (lambda: GeneralisedMaxwellSlip(0.1, stiffnesses=(1e4, 1e4), shares=(-0.5,)), "shares_0 .* between 0 and 1"),
        (lambda: GeneralisedMaxwellSlip(0.1, stiffnesses=(-1e4,)), "stiffnesses_0 .* must be a positive number of N/m"),
        (lambda: GeneralisedMaxwellSlip(0.1, attraction=-1.0), "attraction .* must not be negative, got -1.0 N/s."),
        (lambda: GeneralisedMaxwellSlip(0.1, 0.05), "mu_s of GeneralisedMaxwellSlip must be at least mu = 0.1"),
        (lambda: GeneralisedMaxwellSlip(-0.1), "mu of GeneralisedMaxwellSlip must be a positive number, got -0.1."),
    ],
)
def test_refusals(build, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        build()
