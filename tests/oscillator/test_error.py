"""The stated numerical error of a motion, and solvers of the user."""

import warnings

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import AbstractFriction, Coulomb, Dahl, Stribeck
from fricjax.oscillator import Motion, Oscillator, Smooth, simulate
from tests.helpers import PROTOTYPE_MASS

TS, X0 = np.linspace(0.0, 0.3, 121), 2e-3


def machine(law: AbstractFriction, damping: float = 0.17) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, 2574.0, damping, 9.66, law)


def error_of(motion: Motion) -> float:
    assert motion.error is not None
    return float(motion.error)


def test_the_closed_form_states_its_rounding():
    motion = simulate(machine(Coulomb(0.05)), X0, TS, error=True)
    assert 0 < error_of(motion) < 1e-16


def test_without_the_request_there_is_none():
    assert simulate(machine(Coulomb(0.05)), X0, TS).error is None


def test_under_vmap_each_motion_has_its_error():
    motions = jax.vmap(lambda mu: simulate(machine(Coulomb(mu)), X0, TS, error=True))(jnp.asarray([0.04, 0.05]))
    assert motions.error is not None and motions.error.shape == (2,) and bool(jnp.all(motions.error > 0))


@pytest.mark.slow
def test_a_request_that_is_missed_is_reported_with_the_error():
    # The friction of this law has an infinite slope at rest.
    singular = machine(Stribeck(0.05, 0.065, 5e-3, 0.5))
    with pytest.warns(UserWarning, match=r"may be off by \S+ m, more than accuracy=1\.0e-10 m"):
        motion = simulate(singular, X0, TS, error=True)
    fine = simulate(singular, X0, TS, accuracy=1e-14)
    assert error_of(motion) == pytest.approx(float(np.max(np.abs(motion.x - fine.x))), rel=1.0)


@pytest.mark.slow
def test_the_undamped_vibration_of_a_contact_stays_accurate():
    # Without damping the contact vibrates for long, and the errors of all steps add up.
    ringing = machine(Dahl(0.05, sigma0=1e5), damping=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion = simulate(ringing, X0, np.linspace(0.0, 2.0, 801), error=True)
    assert error_of(motion) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("method", [diffrax.Tsit5(), diffrax.Kvaerno5()], ids=["Tsit5", "Kvaerno5"])
def test_solvers_of_diffrax_give_the_same_motion(method: diffrax.AbstractAdaptiveSolver):
    dahl = machine(Dahl(0.05, sigma0=1e5))
    found = simulate(dahl, X0, TS, engine=Smooth(method=method))
    np.testing.assert_allclose(found.x, simulate(dahl, X0, TS).x, rtol=0, atol=1e-10)
