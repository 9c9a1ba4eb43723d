"""Pendulums up to the top, against elliptic integrals and an event-driven integration."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ellipkm1

from fricjax.friction import Coulomb
from fricjax.oscillator import Hybrid, Oscillator, starting_state
from fricjax.oscillator.engines.hybrid import Span
from fricjax.oscillator.restoring import Pendulum
from tests.oracles import Machine, Slide, slide

SPRING = Pendulum()
K, DAMPING, DRAG, FRICTION = 30.857, 0.00368, 0.00178, 0.21557
MACHINE = Oscillator(1.0, K, DAMPING, 1.0, Coulomb(FRICTION), restoring=SPRING, drag=DRAG)
PLAIN = Machine(1.0, DAMPING, lambda x: K * np.sin(x), lambda speed: FRICTION, FRICTION, DRAG)


def test_a_table_is_over_the_ratio_of_the_periods():
    ratio = jnp.geomspace(1e-5, 300, 25)
    # The complements m and 1 - m, both without cancellation.
    m, rest = (ratio / 2) ** 2 / (1 + (ratio / 2) ** 2), 1 / (1 + (ratio / 2) ** 2)
    expected = np.log(ellipkm1(np.asarray(rest)) / ellipkm1(np.asarray(m)))
    np.testing.assert_allclose(SPRING.spread(ratio), expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(SPRING.spread(np.asarray(ratio)), expected, rtol=0, atol=1e-14)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(SPRING.gathered(jnp.asarray(expected)), ratio, rtol=1e-13)
    step = 1e-5 * ratio
    slopes = (SPRING.spread(ratio + step) - SPRING.spread(ratio - step)) / (2 * step)
    np.testing.assert_allclose(jax.vmap(jax.grad(SPRING.spread))(ratio), slopes, rtol=1e-8)


@pytest.mark.parametrize("x", [0.1, 1.5, 3.1])
def test_the_stretched_coordinate_has_the_energy_of_a_linear_spring(x: float):
    q = SPRING.stretched(jnp.asarray(x))
    assert K * q**2 / 2 == pytest.approx(float(SPRING.potential(jnp.asarray(x), jnp.asarray(K))), rel=1e-14)
    back, slope = SPRING.unstretched(q)
    assert float(back) == pytest.approx(x, rel=1e-12)
    assert float(slope) == pytest.approx(float(jax.grad(SPRING.stretched)(jnp.asarray(x))), rel=1e-11)
    steep = SPRING.steepened(jnp.asarray(x))
    assert float(steep) == pytest.approx(float(q / slope), rel=1e-11)
    assert float(SPRING.unsteepened(steep)) == pytest.approx(x, rel=1e-14)


def test_periods_without_losses_are_elliptic_integrals():
    free = Oscillator(2.0, 7.0, 0.0, 1.0, Coulomb(0.0), restoring=SPRING)

    @jax.jit
    def two_half_cycles(x0: jax.Array) -> jax.Array:
        return Hybrid(32, 16).path(free, starting_state(free, x0, 0.0), jnp.asarray(2)).t_stop  # type: ignore

    for x0 in (0.05, 1.0, 2.0, 2.6, 3.0, 3.1):
        expected = 4 * ellipkm1(np.cos(x0 / 2) ** 2) * np.sqrt(2.0 / 7.0)
        assert float(two_half_cycles(jnp.asarray(x0))) == pytest.approx(expected, rel=1e-8), x0


@pytest.fixture(scope="module", params=[1.5, 2.95, 3.1])
def motion(request) -> tuple[float, np.ndarray, Slide]:
    ts = np.linspace(0, 70, 3501)
    return request.param, ts, slide(PLAIN, request.param, 0.0, ts)


@eqx.filter_jit
def read(engine: Hybrid, x0: jax.Array, half_cycles: jax.Array, ts: jax.Array) -> jax.Array:
    return engine.path(MACHINE, starting_state(MACHINE, x0, 0.0), half_cycles).sample(ts)[0]


@pytest.mark.slow
def test_table_and_half_cycles_one_by_one_are_the_motion_integrated_from_event_to_event(motion):
    x0, ts, expected = motion
    highest = SPRING.unsteepened(1.1 * SPRING.steepened(np.float64(x0)))  # pyright: ignore[reportArgumentType]
    span, count = Span(np.abs(expected.points[-3]), np.asarray(highest)), jnp.asarray(expected.times.size)
    for engine, most in ((Hybrid(32, 128), 1e-7), (Hybrid(32, 128, span, 32), 5e-7)):
        error = np.max(np.abs(np.asarray(read(engine, jnp.asarray(x0), count, jnp.asarray(ts))) - expected.x))
        print(f"{x0} rad, {'one by one' if engine.span is None else 'table'}: {error:.1e} rad")
        assert error < most
