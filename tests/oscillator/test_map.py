"""Map from initial to final displacement.

It is a triangle wave for equal coefficients and a sawtooth for unequal ones.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, Stribeck, Tanh
from fricjax.oscillator import Exact, Hybrid, Oscillator, final_displacement

STIFFNESS, FORCE = 5000.0, 0.981
DEAD_BAND = FORCE / STIFFNESS
RATIOS, ZETAS = (1.0, 1.3, 2.5), (0.0, 0.01, 0.1)
EDGES = 7


def machine(zeta, ratio, dead_band=DEAD_BAND):
    mu = dead_band * STIFFNESS / 9.81
    return Oscillator(1.0, STIFFNESS, 2 * zeta * np.sqrt(STIFFNESS), 9.81, Coulomb(mu, ratio * mu))


@jax.jit
def final(x0, zeta, ratio, dead_band=DEAD_BAND):
    def one(x):
        return final_displacement(machine(zeta, ratio, dead_band), x, engine=Exact(64))

    return jax.vmap(one)(x0)


def edges(zeta: float, ratio: float) -> tuple[np.ndarray, float]:
    """Initial displacements at the onset of one more half-cycle.

    Also return the decay factor per half-cycle.
    """
    rho = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    n, xs = np.arange(EDGES), ratio * DEAD_BAND
    if zeta == 0:
        return xs + 2 * n * DEAD_BAND, rho
    centre = DEAD_BAND * (1 + rho) / (1 - rho)
    return rho**-n * (xs + centre) - centre, rho


@pytest.mark.parametrize("zeta", ZETAS)
@pytest.mark.parametrize("ratio", RATIOS)
class TestSegments:
    def test_jump_at_each_edge(self, zeta: float, ratio: float):
        where, rho = edges(zeta, ratio)
        below, above = (final(where * (1 + s), zeta, ratio) for s in (-1e-9, 1e-9))
        jump = (1 + rho) * (ratio - 1) * DEAD_BAND
        np.testing.assert_allclose(np.abs(above - below), jump, rtol=0, atol=1e-7 * DEAD_BAND)

    def test_ends_of_the_segments(self, zeta: float, ratio: float):
        where, rho = edges(zeta, ratio)
        sign = (-1.0) ** np.arange(EDGES)
        top = sign * final(where * (1 - 1e-9), zeta, ratio)
        np.testing.assert_allclose(top, ratio * DEAD_BAND, rtol=1e-7)
        bottom = -sign * final(where * (1 + 1e-9), zeta, ratio)
        np.testing.assert_allclose(bottom, (rho * ratio - 1 - rho) * DEAD_BAND, rtol=0, atol=1e-7 * DEAD_BAND)

    def test_widths_and_slopes(self, zeta: float, ratio: float):
        where, rho = edges(zeta, ratio)
        n = np.arange(1, EDGES)
        width = rho**-n * ((1 + rho) + (1 - rho) * ratio) * DEAD_BAND
        np.testing.assert_allclose(np.diff(where), width, rtol=1e-9)
        inside = (where[:-1] + where[1:]) / 2
        slope = jax.jvp(lambda x: final(x, zeta, ratio), (jnp.asarray(inside),), (jnp.ones(n.size),))[1]
        np.testing.assert_allclose(slope, (-rho) ** n, rtol=1e-11)

    def test_derivatives_by_the_bands(self, zeta: float, ratio: float):
        where, rho = edges(zeta, ratio)
        n = np.arange(1, EDGES)
        x0 = jnp.asarray((where[:-1] + where[1:]) / 2)
        total = n if zeta == 0 else (1 - rho**n) / (1 - rho)
        one, zero = jnp.ones(()), jnp.zeros(())
        by_band = jax.jvp(lambda b: final(x0, zeta, ratio, b), (DEAD_BAND * one,), (one,))[1]
        np.testing.assert_allclose(by_band, (-1.0) ** (n + 1) * (1 + rho) * total, rtol=1e-11)
        by_static = jax.jvp(lambda r: final(x0, zeta, r), (ratio + zero,), (one,))[1]
        np.testing.assert_array_equal(by_static, 0.0)

    def test_amplitude_and_gap(self, zeta: float, ratio: float):
        x0 = jnp.linspace(1e-6, edges(zeta, ratio)[0][-1], 4001)
        rest = np.abs(final(x0, zeta, ratio))
        assert np.max(rest) <= ratio * DEAD_BAND * (1 + 1e-12)
        assert np.max(rest) > 0.99 * ratio * DEAD_BAND
        if zeta == 0 and ratio > 2:
            moved = rest[x0 > ratio * DEAD_BAND]
            assert np.min(moved) >= (ratio - 2) * DEAD_BAND * (1 - 1e-9)


@pytest.mark.parametrize("zeta", ZETAS)
def test_zeros(zeta: float):
    rho = edges(zeta, 1.0)[1]
    j = np.arange(1, 6)
    zeros = 2 * j * DEAD_BAND if zeta == 0 else DEAD_BAND * (1 + rho) / (1 - rho) * (rho ** -j.astype(float) - 1)
    np.testing.assert_allclose(final(zeros, zeta, 1.0), 0.0, atol=1e-12 * zeros[-1])


@pytest.mark.slow
def test_the_hybrid_engine_draws_the_same_map():
    x0 = jnp.linspace(1e-5, 3e-3, 41)
    hybrid = jax.jit(jax.vmap(lambda x: final_displacement(machine(0.01, 1.3), x, engine=Hybrid(max_half_cycles=16))))
    np.testing.assert_allclose(hybrid(x0), final(x0, 0.01, 1.3), rtol=0, atol=1e-12)


def test_a_static_coefficient_below_the_dynamic_one_counts_as_the_dynamic_one():
    x0 = jnp.linspace(1e-5, 3e-3, 41)
    np.testing.assert_array_equal(final(x0, 0.01, 0.4), final(x0, 0.01, 1.0))


@pytest.mark.slow
def test_a_mass_that_never_rests_ends_nowhere():
    growing = Oscillator(1.0, 5000.0, -5.0, 9.81, Stribeck(0.01))
    assert np.isnan(final_displacement(growing, 3e-3, engine=Hybrid(max_half_cycles=16)))
    assert np.isnan(final_displacement(Oscillator(1.0, 5000.0, -5.0, 9.81, Coulomb(0.01)), 3e-3))


def test_a_creeping_law_has_no_final_displacement():
    with pytest.raises(ValueError, match="Under Tanh the mass creeps and never rests"):
        final_displacement(Oscillator(1.0, 5000.0, 0.0, 9.81, Tanh(0.1, 1e-4)), 1e-3)
