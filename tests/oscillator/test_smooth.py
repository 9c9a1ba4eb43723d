"""Smooth engine against SciPy on rolling runs.

The runs start at 2 mm, with 12.6 Hz and a load of 1.89 N.
"""

import numpy as np
import pytest

from fricjax.friction import LuGre, Tanh
from fricjax.oscillator import Oscillator, Smooth, final_displacement, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import lugre_motion, tanh_motion

M, K, C = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING
PLAIN = {"mass": M, "stiffness": K, "damping": C}
TS = np.linspace(0, 2, 2001)
TENTH_OF_A_NANOMETRE = 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("v_s", [1e-3, 1e-4])
def test_tanh(v_s: float):
    motion = simulate(Oscillator(M, K, C, 1.89, Tanh(0.01, v_s)), 2e-3, TS, engine="smooth")
    expected = tanh_motion(TS, 2e-3, **PLAIN, kinetic=0.0189, v_s=v_s)
    np.testing.assert_allclose(motion.x, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)


@pytest.mark.slow
@pytest.mark.parametrize("mu_s", [0.01, 0.013])
def test_lugre(mu_s: float):
    sigma = (1e5, 1.4 * np.sqrt(1e5 * M), 0.0)
    law = LuGre(0.01, mu_s, 5e-3, *sigma)
    ts = TS[: 2001 if mu_s == 0.01 else 1001]
    motion = simulate(Oscillator(M, K, C, 1.89, law), 2e-3, ts)
    expected = lugre_motion(
        ts, 2e-3, **PLAIN, kinetic=0.0189, static=1.89 * mu_s, v_stribeck=5e-3, sigma=sigma, rtol=1e-12
    )
    assert motion.engine == "smooth"
    np.testing.assert_allclose(motion.x, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)


@pytest.mark.slow
def test_samples_before_time_zero_continue_the_motion():
    machine = Oscillator(M, K, C, 1.89, Tanh(0.01, 1e-3))
    early = simulate(machine, 2e-3, np.array([-1e-5, 0.0, 1e-3]), v0=0.1)
    assert float(early.x[0]) == pytest.approx(2e-3 - 1e-6, rel=1e-6)
    assert float(early.x[1]) == pytest.approx(2e-3, rel=1e-15)


@pytest.mark.slow
def test_an_integration_out_of_steps_says_so():
    machine = Oscillator(M, K, C, 1.89, Tanh(0.01, 1e-3))
    motion = simulate(machine, 2e-3, np.array([0.1, 0.2]), engine=Smooth(max_steps=10))
    assert "max_steps" in str(motion.result) or "maximum number of solver steps" in str(motion.result)


@pytest.mark.slow
def test_bristles_hold_the_mass_where_it_stops():
    sigma0 = 1e5
    machine = Oscillator(M, K, C, 9.66, LuGre(0.05, sigma0=sigma0, sigma1=2 * np.sqrt(sigma0 * M)))
    final = float(final_displacement(machine, 2e-3))
    motion = simulate(machine, 2e-3, np.array([0.5, 0.8]))
    np.testing.assert_allclose(motion.x, final, rtol=0, atol=1e-12)
    assert abs(final) < float(machine.dead_band)
    np.testing.assert_allclose(motion.friction_force, -K * motion.x, rtol=1e-6)
