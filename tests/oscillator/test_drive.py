"""Driven motion: a fading holding force and a moving floor."""

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, Tanh
from fricjax.oscillator import ExponentialRelease, Oscillator, simulate

OMEGA, ZETA = 2 * np.pi * 12.6, 0.01
FRICTIONLESS = Oscillator(1.0, OMEGA**2, 0.0, 1.0, Tanh(0.0, 1e-3))
DAMPED = Oscillator(1.0, OMEGA**2, 2 * ZETA * OMEGA, 1.0, Tanh(0.0, 1e-3))


@pytest.mark.slow
@pytest.mark.parametrize("tau", [1e-3, 3e-3])
def test_a_fading_magnet_takes_amplitude_away(tau: float):
    ts = np.linspace(0, 0.3, 601)
    motion = simulate(FRICTIONLESS, 1e-3, ts, release=ExponentialRelease(tau))
    # m x'' + k x = k x0 exp(-t/tau): an oscillation smaller by 1/sqrt(1 + (omega tau)^2), and a transient.
    q = (OMEGA * tau) ** 2
    transient = q / (1 + q) * np.exp(-ts / tau)
    swing = np.cos(OMEGA * ts) / (1 + q) + OMEGA * tau / (1 + q) * np.sin(OMEGA * ts)
    np.testing.assert_allclose(motion.x, 1e-3 * (swing + transient), rtol=0, atol=1e-10)
    late = ts > 20 * tau
    amplitude = np.max(np.hypot(motion.x[late], motion.v[late] / OMEGA))
    assert amplitude == pytest.approx(1e-3 / np.sqrt(1 + q), rel=1e-6)


@pytest.mark.slow
def test_a_floor_that_shakes_at_resonance():
    ts = np.linspace(0, 0.5, 20_001)
    drive = 0.02
    motion = simulate(DAMPED, 0.0, ts, base_acceleration=drive * np.sin(OMEGA * ts))
    omega_d = OMEGA * np.sqrt(1 - ZETA**2)
    steady = drive / (2 * ZETA * OMEGA**2)
    decay = np.exp(-ZETA * OMEGA * ts)
    expected = steady * (
        np.cos(OMEGA * ts) - decay * (np.cos(omega_d * ts) + ZETA * OMEGA / omega_d * np.sin(omega_d * ts))
    )
    np.testing.assert_allclose(motion.x, expected, rtol=0, atol=2e-6 * steady)


@pytest.mark.slow
def test_the_bias_of_a_driven_smoothed_law_is_unknown():
    motion = simulate(FRICTIONLESS, 1e-3, np.array([0.1]), release=ExponentialRelease(1e-3))
    assert motion.engine == "smooth"
    assert np.isnan(motion.regularisation_bias)


@pytest.mark.slow
@pytest.mark.parametrize(
    "drive", [{"release": ExponentialRelease(1e-3)}, {"base_acceleration": jnp.zeros(3)}], ids=["release", "floor"]
)
def test_half_cycle_engines_cannot_be_driven(drive: dict):
    machine = Oscillator(1.0, 5000.0, 0.0, 9.81, Coulomb(0.1))
    with pytest.raises(ValueError, match="need integration in time: leave the engine to auto"):
        simulate(machine, 1e-3, np.linspace(0, 1, 3), engine="exact", **drive)
    assert simulate(machine, 1e-3, np.linspace(0, 1, 3), **drive).engine == "diffrax"
