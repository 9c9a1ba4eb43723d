"""Half-cycles, reversals and stop of the smooth engine for any requested samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from fricjax.friction import Coulomb, Dahl, LuGre, Tanh
from fricjax.oscillator import Oscillator, Smooth, final_displacement, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import lugre_motion

pytestmark = pytest.mark.slow

M, K, C, N = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66
LAWS = {
    "rings": LuGre(0.05, sigma0=1e6, sigma1=20.0),
    "springs back slowly": LuGre(0.05, sigma0=1e5, sigma1=2 * np.sqrt(1e5 * M)),
    "soft": Dahl(0.05, sigma0=2e4),
}
# The contact bends by at most 1 % of a stroke, so the mass makes as many half-cycles as under Coulomb's law.
HALF_CYCLES = 5
SAMPLINGS = [np.linspace(0, 0.5, n) for n in (2, 21, 5001)]


def machine(law) -> Oscillator:
    return Oscillator(M, K, C, N, law)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_half_cycles_and_stop_are_those_of_the_motion(law):
    found = [simulate(machine(law), 2e-3, ts) for ts in SAMPLINGS]
    rigid = simulate(machine(Coulomb(0.05)), 2e-3, SAMPLINGS[0])
    assert int(rigid.n_half_cycles) == HALF_CYCLES
    for motion in found:
        assert int(motion.n_half_cycles) == HALF_CYCLES
        np.testing.assert_allclose(motion.turning_points, found[0].turning_points, rtol=0, atol=1e-13)
        assert float(motion.t_stop) == pytest.approx(float(found[0].t_stop), abs=1e-11)
        assert np.isfinite(motion.turning_points).sum() == HALF_CYCLES + 1
    # The contact delays each reversal by about sqrt(2 l/a), with a deflection l of some tens of micrometres.
    assert float(found[0].t_stop) == pytest.approx(float(rigid.t_stop), rel=0.04)
    reversals = found[0].turning_points[: HALF_CYCLES + 1]
    np.testing.assert_allclose(reversals, rigid.turning_points[: HALF_CYCLES + 1], rtol=0, atol=8e-5)


def test_reversals_and_stop_against_scipy():
    """Compare with roots of the velocity from SciPy's dense solution."""
    sigma = (1e5, 2 * np.sqrt(1e5 * M), 0.0)

    def oracle(times):
        plain = {"mass": M, "stiffness": K, "damping": C, "kinetic": 0.05 * N, "static": 0.05 * N}
        return lugre_motion(np.append(0.0, times), 2e-3, **plain, v_stribeck=1e-3, sigma=sigma, rtol=1e-12)[1:]

    motion = simulate(machine(LAWS["springs back slowly"]), 2e-3, np.array([0.25]))
    step = 1e-5
    speed = lambda at: float(np.diff(oracle(np.array([at - step, at + step])))[0])
    stop: float = brentq(speed, 0.19, 0.205, xtol=1e-9)  # type: ignore[assignment]
    assert float(motion.t_stop) == pytest.approx(stop, abs=1e-6)
    assert float(motion.turning_points[HALF_CYCLES]) == pytest.approx(float(oracle(np.array([stop]))[0]), abs=1e-9)


@pytest.mark.parametrize("law", [LAWS["rings"], LAWS["springs back slowly"]], ids=["rings", "springs back slowly"])
def test_the_mass_is_at_rest_where_it_no_longer_moves(law):
    """Compare `at_rest` with the distance to the final position.

    Samples at rest are within 0.5 nm of the final position. Some earlier sample is farther away.
    """
    ts = np.linspace(0.15, 1.5, 2701)
    motion, final = simulate(machine(law), 2e-3, ts), float(final_displacement(machine(law), 2e-3))
    first = int(np.argmax(motion.at_rest))
    assert first > 0 and np.all(motion.at_rest[first:]) and ts[first] > motion.t_stop
    assert np.max(np.abs(motion.x[first:] - final)) < 5e-10
    assert np.max(np.abs(motion.x[:first] - final)) > 1e-8


def test_before_the_stop_there_is_none():
    motion = simulate(machine(LAWS["rings"]), 2e-3, np.array([0.1]))
    assert int(motion.n_half_cycles) == 2 and np.isinf(motion.t_stop) and not motion.at_rest[0]


def test_a_start_within_the_dead_band_makes_no_half_cycle():
    motion = simulate(machine(LAWS["rings"]), 0.5 * float(machine(LAWS["rings"]).dead_band), np.array([0.1, 0.5]))
    assert int(motion.n_half_cycles) == 0 and motion.t_stop == 0.0


def test_a_start_in_motion_completes_its_stroke():
    found = [simulate(machine(LAWS["rings"]), -1e-3, ts, v0=0.12) for ts in SAMPLINGS[:2]]
    rigid = simulate(machine(Coulomb(0.05)), -1e-3, SAMPLINGS[0], v0=0.12)
    assert {int(motion.n_half_cycles) for motion in found} == {int(rigid.n_half_cycles)}


def test_a_law_that_creeps_never_stops():
    law = Tanh(0.05, 1e-3)
    found = [simulate(machine(law), 2e-3, ts, engine="smooth") for ts in SAMPLINGS]
    assert len({int(motion.n_half_cycles) for motion in found}) == 1
    assert all(np.isinf(motion.t_stop) and not np.any(motion.at_rest) for motion in found)
    n = int(found[0].n_half_cycles)
    dense = np.asarray(simulate(machine(law), 2e-3, np.linspace(0, 0.5, 500_001), engine="smooth").x)
    turns = np.flatnonzero(np.diff(dense)[:-1] * np.diff(dense)[1:] < 0) + 1
    assert n == turns.size
    np.testing.assert_allclose(found[0].turning_points[1 : n + 1], dense[turns], rtol=0, atol=1e-10)


def test_derivatives_of_stop_and_reversals():
    """Compare derivatives in the stiffness with differences."""
    ts = jnp.asarray([0.3])

    def told(stiffness):
        motion = simulate(Oscillator(M, stiffness, C, N, LAWS["springs back slowly"]), 2e-3, ts, engine=Smooth(1e-12))
        return motion.t_stop, motion.turning_points[1 : HALF_CYCLES + 1]

    _, (stop, points) = jax.jvp(told, (K,), (1.0,))
    above, below = told(K + 1.0), told(K - 1.0)
    assert float(stop) == pytest.approx(float(above[0] - below[0]) / 2, rel=1e-3)
    np.testing.assert_allclose(points, (above[1] - below[1]) / 2, rtol=1e-3)


def test_the_list_holds_as_many_half_cycles_as_it_can():
    motion = simulate(machine(LAWS["rings"]), 2e-3, SAMPLINGS[0], engine=Smooth(max_half_cycles=3))
    assert motion.turning_points.shape == (4,) and int(motion.n_half_cycles) == HALF_CYCLES


class TestFinalDisplacement:
    def test_a_contact_that_rings_for_long_is_waited_for(self):
        """Compare with SciPy after 8 s.

        The ringing has then decayed by exp(-20).
        """
        law = LuGre(0.05, sigma0=1e5, sigma1=2.0)
        plain = {"mass": M, "stiffness": K, "damping": C, "kinetic": 0.05 * N, "static": 0.05 * N}
        late = lugre_motion(np.array([0.0, 8.0]), 2e-3, **plain, v_stribeck=1e-3, sigma=(1e5, 2.0, 0.0), rtol=1e-11)
        assert float(final_displacement(machine(law), 2e-3)) == pytest.approx(late[-1], abs=2e-10)
        early = simulate(machine(law), 2e-3, np.array([0.3])).x[0]
        assert abs(float(early) - late[-1]) > 1e-6

    def test_a_motion_that_does_not_come_to_rest_has_none(self):
        assert np.isnan(final_displacement(machine(LAWS["rings"]), 2e-3, engine=Smooth(max_steps=500)))

    def test_it_may_be_vmapped_and_differentiated(self):
        oscillator, starts = machine(LAWS["springs back slowly"]), jnp.asarray([2e-3, 1.7e-3])
        found = jax.vmap(lambda x: final_displacement(oscillator, x))(starts)
        alone = [float(final_displacement(oscillator, x)) for x in starts]
        np.testing.assert_allclose(found, alone, rtol=0, atol=1e-12)
        _, slope = jax.jvp(lambda x: final_displacement(oscillator, x), (2e-3,), (1.0,))
        ends = [float(final_displacement(oscillator, 2e-3 + s * 1e-7)) for s in (1, -1)]
        assert float(slope) == pytest.approx((ends[0] - ends[1]) / 2e-7, rel=1e-3)
