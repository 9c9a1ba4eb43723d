"""Golden runs with rest positions known to twelve digits, by every engine."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, Tanh
from fricjax.oscillator import Exact, Hybrid, Motion, Oscillator, final_displacement, simulate
from tests.helpers import (
    FIG_2,
    FIG_2_TURNING_POINTS,
    FIG_2_V,
    FIG_2_X,
    FIG_9,
    FIG_9_X,
    GOLDEN,
    SAMPLE_TIMES,
)
from tests.tiers import cases

X0 = jnp.asarray([case.x0 for case in GOLDEN])
EXPECTED = {name: np.array([getattr(case, name) for case in GOLDEN]) for name in ("half_cycles", "final", "t_stop")}
ENGINES = {"exact": (Exact(320), 1e-9), "hybrid": (Hybrid(max_half_cycles=320), 1e-8)}


def golden_machines() -> Oscillator:
    """All golden oscillators in one, with a leading axis."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *(case.oscillator() for case in GOLDEN))


@pytest.fixture(scope="module", params=cases(ENGINES, ["exact"]))
def engine(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def motions(engine: str) -> Motion:
    times = jnp.concatenate([jnp.asarray(SAMPLE_TIMES), jnp.asarray([20.0])])
    run = eqx.filter_vmap(lambda machine, x0: simulate(machine, x0, times, engine=ENGINES[engine][0]))
    return run(golden_machines(), X0)


def test_rest_position(engine: str, motions: Motion):
    print(f"{engine}: worst relative error of x_f {np.max(np.abs(motions.x[:, -1] / EXPECTED['final'] - 1)):.1e}")
    np.testing.assert_allclose(motions.x[:, -1], EXPECTED["final"], rtol=ENGINES[engine][1])
    assert np.all(motions.at_rest[:, -1])
    assert np.all(motions.v[:, -1] == 0)


def test_number_of_half_cycles(motions: Motion):
    np.testing.assert_array_equal(motions.n_half_cycles, EXPECTED["half_cycles"])
    np.testing.assert_array_equal(np.isfinite(motions.turning_points).sum(axis=1), EXPECTED["half_cycles"] + 1)


def test_time_of_the_stop(engine: str, motions: Motion):
    np.testing.assert_allclose(motions.t_stop, EXPECTED["t_stop"], rtol=ENGINES[engine][1])


def test_the_last_turning_point_is_the_rest_position(motions: Motion):
    last = [points[n] for points, n in zip(motions.turning_points, EXPECTED["half_cycles"], strict=True)]
    np.testing.assert_allclose(last, motions.x[:, -1], rtol=1e-13)


@pytest.mark.parametrize(("row", "x"), [(GOLDEN.index(FIG_2), FIG_2_X), (GOLDEN.index(FIG_9), FIG_9_X)])
def test_trace_samples(engine: str, motions: Motion, row: int, x: np.ndarray):
    print(f"{engine}: worst error of the samples {np.max(np.abs(motions.x[row, :-1] - x)):.1e} m")
    tolerance = {"exact": {"rtol": 0, "atol": 1e-12}, "hybrid": {"rtol": 1e-8}}[engine]
    np.testing.assert_allclose(motions.x[row, :-1], x, **tolerance)


def test_velocity_samples(engine: str, motions: Motion):
    tolerance = {"exact": 1e-10, "hybrid": 1e-6}[engine]
    np.testing.assert_allclose(motions.v[GOLDEN.index(FIG_2), :-1], FIG_2_V, rtol=0, atol=tolerance)


def test_turning_points_of_the_paper(motions: Motion):
    points = motions.turning_points[GOLDEN.index(FIG_2)]
    np.testing.assert_allclose(points[:9], FIG_2_TURNING_POINTS, rtol=0, atol=1e-15)
    assert np.all(np.isnan(points[9:]))


def test_final_displacement_agrees_with_the_motion(engine: str):
    case = GOLDEN[9]
    final = final_displacement(case.oscillator(), case.x0, engine=engine)
    assert float(final) == pytest.approx(case.final, rel=1e-8)


# Displacement [mm] of the smoothed law at the exact stop and 0.1, 1 and 10 s later. It creeps back with x_d/v_s.
CREEP = {
    1e-2: (0.0223, -0.0003, 0, 0),
    3e-3: (-0.0860, -0.0164, 0, 0),
    1e-3: (-0.1305, -0.0738, -0.0007, 0),
    1e-4: (-0.1391, -0.1307, -0.0784, -0.0008),
    1e-5: (-0.1392, -0.1383, -0.1308, -0.0785),
    1e-6: (-0.1392, -0.1391, -0.1383, -0.1308),
}


@pytest.fixture(scope="module")
def smoothed() -> Motion:
    times = FIG_2.t_stop + jnp.asarray([0, 0.1, 1, 10.0])

    def run(v_s: float) -> Motion:
        law = Tanh(FIG_2.mu, v_s)
        return simulate(Oscillator(1.0, 5000.0, 0.0, FIG_2.normal_force, law), FIG_2.x0, times, engine="smooth")

    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *(run(v_s) for v_s in CREEP))


def test_the_smoothed_law_creeps_as_tabulated(smoothed: Motion):
    np.testing.assert_allclose(smoothed.x * 1e3, list(CREEP.values()), rtol=0, atol=0.5001e-4)


def test_creep_is_of_first_order_and_the_motion_before_it_of_higher(smoothed: Motion):
    error = np.abs(smoothed.x - FIG_2.final)
    order = np.log10(error[3:5] / error[4:6])
    np.testing.assert_allclose(order[:, 1], 1.0, atol=0.05)
    assert np.all(order[:, 0] > 0.95)
    expected = [v_s * 0.1 * np.arctanh(0.1392 / 0.1962) for v_s in (1e-5, 1e-6)]
    np.testing.assert_allclose(error[4:, 1] - error[4:, 0], expected, rtol=0.01)


def test_the_bias_of_a_smoothed_law_is_its_distance_to_the_sharp_motion(smoothed: Motion):
    np.testing.assert_allclose(
        smoothed.regularisation_bias, np.max(np.abs(smoothed.x - FIG_2.final), axis=1), rtol=1e-6
    )


def test_a_law_without_smoothing_has_no_bias(motions: Motion):
    assert np.all(motions.regularisation_bias == 0)


def test_mu_s_equal_to_mu_is_the_tied_law():
    tied = Oscillator(1.0, 5000.0, 0.0, 9.81, Coulomb(0.1))
    assert float(final_displacement(tied, 3e-3)) == pytest.approx(FIG_2.final, rel=1e-12)
