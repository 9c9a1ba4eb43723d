"""Motions under laws without memory, against ODE solvers and rest conditions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fricjax.friction import Ageing, Coulomb, LoadDependent, Lorentzian, Makkar, Viscous
from fricjax.oscillator import Oscillator, is_successful, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import Machine, slide

M, K, C, N, X0 = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66, 1e-3
TS = np.linspace(0, 0.2, 401)
MAKKAR = Makkar(0.015, 1e3, 1e2, 0.05, 2e3, 0.5)


def machine(law) -> Oscillator:
    return Oscillator(M, K, C, N, law)


def plain(sliding, static: float) -> Machine:
    return Machine(M, C, lambda x: K * x, sliding, static)


@pytest.mark.slow
def test_makkar_moves_and_creeps_as_an_ode_solver_tells():
    def rates(_t, y):
        hump = np.tanh(1e3 * y[1]) - np.tanh(1e2 * y[1])
        force = N * (0.015 * hump + 0.05 * np.tanh(2e3 * y[1])) + (0.5 + C) * y[1]
        return y[1], -(K * y[0] + force) / M

    expected = solve_ivp(rates, (0, TS[-1]), (X0, 0.0), method="Radau", t_eval=TS, rtol=1e-10, atol=1e-15).y[0]
    motion = simulate(machine(MAKKAR), X0, TS)
    assert motion.engine == "hybrid" and is_successful(motion.result)
    assert motion.stats["t_handover"] < TS[-1]
    np.testing.assert_allclose(motion.x, expected, rtol=0, atol=1e-10)
    sharp = slide(plain(lambda u: N * (0.015 * (1 - np.tanh(1e2 * u)) + 0.05) + 0.5 * u, 0.065 * N), X0, 0.0, TS).x
    assert motion.regularisation_bias == pytest.approx(np.max(np.abs(sharp - expected)), rel=1e-4)


@pytest.mark.slow
def test_the_lorentzian_moves_as_an_ode_solver_tells():
    expected = slide(plain(lambda u: N * (0.05 + 0.015 / (1 + (u / 5e-3) ** 2)), 0.065 * N), X0, 0.0, TS)
    motion = simulate(machine(Lorentzian(0.05, 0.065, 5e-3)), X0, TS)
    np.testing.assert_allclose(motion.x, expected.x, rtol=0, atol=1e-10)
    assert motion.n_half_cycles == expected.times.size


@pytest.mark.slow
def test_a_viscous_contact_damps_like_the_machine():
    contact = simulate(machine(Coulomb(0.05) + Viscous(0.5)), X0, TS)
    damped = simulate(Oscillator(M, K, C + 0.5, N, Coulomb(0.05)), X0, TS)
    assert (contact.engine, damped.engine) == ("hybrid", "exact")
    np.testing.assert_allclose(contact.x, damped.x, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_a_load_dependent_law_is_integrated_in_closed_form():
    law = LoadDependent(0.05, 2 / 3, 5.0, 0.02)
    mu = 0.05 * (N / 5.0) ** (-1 / 3) + 0.02 / N
    motion, same = (simulate(machine(law), X0, TS) for law in (law, Coulomb(mu)))
    assert motion.engine == "exact"
    np.testing.assert_allclose(motion.x, same.x, rtol=0, atol=1e-16)

    def where(load):
        return simulate(Oscillator(M, K, C, load, law), X0, TS[:40], engine="exact").x[-1]

    slope = float(jax.jacfwd(where)(jnp.asarray(N)))
    assert slope == pytest.approx(float(where(jnp.asarray(N + 1e-4)) - where(jnp.asarray(N - 1e-4))) / 2e-4, rel=1e-5)


class TestAgeing:
    """Ageing contact with mu_s N/k = 0.188 mm.

    After a dwell of 53.6 s the static band is 0.226 mm.
    """

    law = Ageing(0.03, 0.0025, 53.6, 0.05)
    breakaway = (0.05 + 0.0025 * np.log(1 + 53.6)) * N / K

    @pytest.mark.slow
    @pytest.mark.parametrize("engine", ["exact", "hybrid"])
    def test_a_start_between_the_static_and_the_breakaway_force_stays(self, engine):
        starts = np.array([0.9, 0.99, 1.01]) * self.breakaway
        assert starts[0] > 0.05 * N / K
        counts = [int(simulate(machine(self.law), x, TS, engine=engine).n_half_cycles) for x in starts]
        assert counts == [0, 0, 1]

    @pytest.mark.slow
    @pytest.mark.parametrize("engine", ["exact", "hybrid"])
    def test_at_reversals_and_in_motion_the_contact_has_no_age(self, engine):
        # With this start the first reversal lies between the two bands, and the mass moves on.
        start = 0.115 * N / K
        fresh = simulate(machine(Coulomb(0.03, 0.05)), start, TS, engine="exact")
        assert 0.05 * N / K < abs(fresh.turning_points[1]) < self.breakaway
        aged = simulate(machine(self.law), start, TS, engine=engine)
        assert aged.n_half_cycles == fresh.n_half_cycles > 1
        np.testing.assert_allclose(aged.x, fresh.x, rtol=0, atol=1e-11)
        kicked = simulate(machine(self.law), 0.9 * self.breakaway, TS, v0=-1e-3, engine=engine)
        assert kicked.n_half_cycles >= 1 and not kicked.at_rest[0]
