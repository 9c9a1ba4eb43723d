"""Half-cycles by collocation, against closed forms and SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fricjax.friction import AbstractFriction, Coulomb, Stribeck, Tanh
from fricjax.oscillator import Oscillator, restoring
from fricjax.oscillator.engines.hybrid.collocation import collocate, make_panels
from fricjax.oscillator.engines.hybrid.frame import Angle, frame_at, phase_rates
from fricjax.oscillator.engines.hybrid.phase_steps import layer_width
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

M, K, C, LOAD = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66
CASES = {
    "Stribeck": (Oscillator(M, K, C, LOAD, Stribeck(0.02, 0.026, 3e-3)), 1e-3),
    "Stribeck, much friction falls": (Oscillator(M, K, C, LOAD, Stribeck(0.02, 0.03, 1e-3)), 1.6e-4),
    "Tanh": (Oscillator(M, K, C, 1.89, Tanh(0.01, 1e-4)), 1e-3),
    "drag": (Oscillator(M, K, C, 1.89, Coulomb(0.01), drag=1.0), 2e-3),
    "pendulum": (Oscillator(0.01, 0.5, 2e-4, 0.4, Coulomb(0.02), restoring=restoring.Pendulum()), 1.2),
    "heavy damping": (Oscillator(M, K, 20.0, 9.66, Coulomb(0.01)), 2e-3),
}


def half_cycle(oscillator: Oscillator, turning: jax.Array, steps: int = 28) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Fractions, amplitudes and times of a half-cycle."""
    frame = frame_at(oscillator, jnp.ones_like(turning), turning)
    panels = make_panels(steps, layer_width(oscillator, frame, turning).ravel()[0])
    return panels.fractions, *collocate(oscillator, frame, turning - frame.dead_band, panels)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_it_solves_the_equation_of_the_phase(name: str):
    machine, turning = CASES[name]
    frame = frame_at(machine, jnp.ones(()), jnp.asarray(turning))
    fractions, amplitudes, times = half_cycle(machine, jnp.asarray(turning))
    rates = jax.jit(lambda theta, y: jnp.stack(phase_rates(machine, frame, y[0], Angle.of(theta))))
    found = solve_ivp(
        lambda theta, y: np.asarray(rates(theta, y)), (0, np.pi), [float(amplitudes[0]), 0.0], method="DOP853",
        t_eval=np.minimum(np.pi * np.asarray(fractions), np.pi), rtol=1e-13, atol=1e-18, max_step=np.pi / 300,
    )  # fmt: skip
    # The mesh is made for 0.1 nm. Collocation is more accurate at the end of the half-cycle than inside.
    speed = turning * frame.angular_frequency
    np.testing.assert_allclose(amplitudes, found.y[0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(
        speed * times * jnp.sin(jnp.pi * fractions), speed * found.y[1] * np.sin(found.t), rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(amplitudes[-1], found.y[0, -1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(speed * times[-1], speed * found.y[1, -1], rtol=0, atol=1e-12)


def test_viscous_damping_and_coulomb_friction_are_exact():
    """Compare with the closed form of a half-cycle.

    It multiplies the distance to the shifted centre by -exp(-pi lambda/omega_d).
    """
    machine = Oscillator(M, K, C, LOAD, Coulomb(0.02))
    decay = C / (2 * M)
    damped = np.sqrt(K / M - decay**2)
    turning = jnp.asarray([2e-3, 5e-4])
    _, amplitudes, times = half_cycle(machine, turning)
    start = np.asarray(turning) - 0.02 * LOAD / K
    np.testing.assert_allclose(amplitudes[-1], start * np.exp(-np.pi * decay / damped), rtol=1e-13)
    np.testing.assert_allclose(times[-1], np.pi / damped, rtol=1e-13)


@pytest.mark.slow
def test_derivatives_of_any_order_and_mode():
    turning = jnp.asarray(1e-3)

    def last(mu: jax.Array) -> jax.Array:
        law: AbstractFriction = Stribeck(mu, 0.026, 3e-3)
        return half_cycle(Oscillator(M, K, C, LOAD, law), turning)[1][-1] * 1e3

    mu, h = jnp.asarray(0.02), 1e-4
    value, slope = jax.jit(last), jax.jit(jax.grad(last))
    first = (value(mu + h) - value(mu - h)) / (2 * h)
    second = (slope(mu + h) - slope(mu - h)) / (2 * h)
    np.testing.assert_allclose(slope(mu), first, rtol=1e-6)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(last))(mu), slope(mu), rtol=1e-12)
    np.testing.assert_allclose(jax.jit(jax.hessian(last))(mu), second, rtol=1e-6)
