"""Half-cycles that the hybrid engine integrates in time.

The cases are creep under a regularised law and starts barely outside the static band.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, QuadraticDrag, Stribeck, Tanh
from fricjax.oscillator import Hybrid, Motion, Oscillator, is_successful, simulate, starting_state
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import Machine, Slide, slide, tanh_motion

M, K, C, N = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66
TENTH_OF_A_NANOMETRE = 1e-10


TS = np.linspace(0, 0.5, 1001)


@pytest.fixture(scope="module", params=[1e-2, 1e-3, 1e-4])
def v_s(request: pytest.FixtureRequest) -> float:
    return request.param


@pytest.fixture(scope="module")
def motion(v_s: float) -> Motion:
    return simulate(Oscillator(M, K, C, N, Tanh(0.05, v_s)), 2e-3, TS)


class TestCreep:
    @pytest.mark.slow
    def test_through_the_stop(self, v_s: float, motion: Motion):
        assert motion.engine == "hybrid" and is_successful(motion.result)
        assert motion.stats["t_handover"] < 0.3
        expected = tanh_motion(TS, 2e-3, mass=M, stiffness=K, damping=C, kinetic=0.05 * N, v_s=v_s)
        np.testing.assert_allclose(motion.x, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)

    @pytest.mark.slow
    def test_as_the_smooth_engine_tells_it(self, v_s: float, motion: Motion):
        machine = Oscillator(M, K, C, N, Tanh(0.05, v_s))
        smooth = simulate(machine, 2e-3, TS, engine="smooth")
        visible = np.abs(np.asarray(smooth.turning_points)) > 1e-9
        n = int(np.sum(visible))
        np.testing.assert_allclose(motion.turning_points[:n], smooth.turning_points[:n], rtol=0, atol=2e-8)
        np.testing.assert_allclose(motion.v, smooth.v, rtol=0, atol=1e-6)
        np.testing.assert_allclose(motion.friction_force, smooth.friction_force, rtol=0, atol=1e-2 * 0.05 * N)
        assert motion.n_half_cycles >= n - 1 and np.isinf(motion.t_stop) and not np.any(motion.at_rest)

    @pytest.mark.slow
    def test_reversals_after_the_last_sample_do_not_count(self):
        machine = Oscillator(M, K, C, N, Tanh(0.05, 1e-3))
        motion = simulate(machine, 2e-3, TS[TS < 0.1])
        assert motion.n_half_cycles == 2
        assert np.isfinite(motion.turning_points).sum() == 3
        assert is_successful(motion.result)

    @pytest.mark.slow
    def test_derivatives_through_the_handover(self):
        ts = np.linspace(0, 0.5, 101)[1:]
        point = np.array([0.05, 1e-3, 2e-3, C, K, M])

        def run(p: jax.Array) -> jax.Array:
            return simulate(Oscillator(p[5], p[4], p[3], N, Tanh(p[0], p[1])), p[2], ts, engine=Hybrid(40, 16)).x

        def plain(p: np.ndarray) -> np.ndarray:
            return tanh_motion(ts, p[2], mass=p[5], stiffness=p[4], damping=p[3], kinetic=p[0] * N, v_s=p[1])

        jacobian = jax.jit(jax.jacfwd(run))(jnp.asarray(point)).T * point[:, None]
        assert_equal_slopes(jacobian, differences(plain, point, np.full(6, 1e-4)), 2e-6)

    @pytest.mark.slow
    def test_lanes_hand_over_each_for_itself(self):
        x0 = jnp.asarray([5e-6, 5e-4, 2e-3])

        def run(x: jax.Array) -> Motion:
            return simulate(Oscillator(M, K, C, N, Tanh(0.05, 1e-3)), x, TS[::20], engine=Hybrid(28, 16))

        together, alone = jax.jit(jax.vmap(run))(x0), [jax.jit(run)(x) for x in x0]
        assert np.all(np.diff(together.stats["t_handover"]) > 0)
        for i, one in enumerate(alone):
            np.testing.assert_allclose(together.x[i], one.x, rtol=0, atol=1e-14)

    @pytest.mark.slow
    def test_a_path_gives_the_same_samples_for_any_part_of_them(self):
        machine = Oscillator(M, K, C, N, Tanh(0.05, 1e-3))
        path = Hybrid(28, 16).path(machine, starting_state(machine, 2e-3, 0.0))
        whole = path.sample(jnp.asarray(TS))[0]
        np.testing.assert_allclose(path.sample(jnp.asarray(TS[:500]))[0], whole[:500], rtol=0, atol=1e-12)

    @pytest.mark.slow
    def test_a_start_that_creeps_from_the_first(self):
        motion = simulate(Oscillator(M, K, C, N, Tanh(0.05, 1e-4)), 1e-4, TS)
        expected = tanh_motion(TS, 1e-4, mass=M, stiffness=K, damping=C, kinetic=0.05 * N, v_s=1e-4)
        np.testing.assert_allclose(motion.x, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)
        assert motion.stats["t_handover"] == 0 and motion.n_half_cycles == 0


class Hair(NamedTuple):
    """Stribeck law with a start barely outside the static band.

    `excess` is the relative distance from the band.
    """

    exponent: float
    v_stribeck: float
    ratio: float
    excess: float
    in_time: bool

    @property
    def x0(self) -> float:
        return (1 + self.excess) * self.ratio * 0.05 * N / K

    def values(self) -> np.ndarray:
        return np.array([0.05, self.ratio * 0.05, self.v_stribeck, self.x0, C, K, M])

    def motion(self, p: Any, ts: Any, engine: Any, v0: Any = 0.0) -> Motion:
        return motion_of(p, self.exponent, ts, engine, v0)

    def slide(self, p: np.ndarray, ts: np.ndarray, v0: float = 0.0) -> Slide:
        def friction(u: float) -> float:
            return N * (p[0] + (p[1] - p[0]) * np.exp(-((u / p[2]) ** self.exponent)))

        return slide(Machine(p[6], p[4], lambda x: p[5] * x, friction, N * p[1]), p[3], v0, ts)


def motion_of(p: Any, exponent: Any, ts: Any, engine: Any, v0: Any = 0.0) -> Motion:
    """Motion for values in the order of `Hair.values`."""
    machine = Oscillator(p[6], p[5], p[4], N, Stribeck(p[0], p[1], p[2], exponent))
    return simulate(machine, p[3], ts, v0=v0, engine=engine)


# One program for all of them.
slopes = eqx.filter_jit(jax.jacfwd(lambda p, exponent, ts, engine: motion_of(p, exponent, ts, engine).x))

HAIRS = [
    Hair(exponent, v_stribeck, ratio, excess, in_time)
    for exponent, v_stribeck, ratio, excess, in_time in [
        (1.0, 5e-3, 1.3, 1e-6, False),
        (1.0, 5e-3, 2.0, 1e-2, True),
        (1.0, 2e-4, 1.3, 1e-2, True),
        (1.0, 2e-4, 2.0, 1e-4, True),
        (1.0, 1e-3, 2.0, 1e-9, True),
        (2.0, 5e-3, 2.0, 2e-2, False),
        (2.0, 1e-3, 2.0, 1e-2, True),
        (2.0, 2e-4, 2.0, 1e-4, True),
        (2.0, 2e-4, 2.0, 1e-9, False),
    ]
]


@pytest.mark.slow
@pytest.mark.parametrize("hair", HAIRS, ids=str)
def test_a_start_by_a_hair(hair: Hair):
    ts = np.linspace(0, 0.35, 351)
    motion, expected = hair.motion(hair.values(), ts, Hybrid(28, 16)), hair.slide(hair.values(), ts)
    assert np.isfinite(motion.stats["t_handover"]) == hair.in_time
    np.testing.assert_allclose(motion.x, expected.x, rtol=0, atol=TENTH_OF_A_NANOMETRE)
    assert int(motion.n_half_cycles) == expected.times.size
    assert motion.t_stop == pytest.approx(expected.t_stop, abs=1e-7)
    n = expected.times.size
    np.testing.assert_allclose(motion.turning_points[1 : n + 1], expected.points, rtol=0, atol=1e-11)
    assert np.all(np.isnan(motion.turning_points[n + 1 :]))


@pytest.mark.slow
@pytest.mark.parametrize("v0", [0.01, -1e-4, -0.02])
def test_a_start_in_motion_close_to_the_edge(v0: float):
    hair, ts = HAIRS[3], np.linspace(0, 0.2, 201)
    motion, expected = hair.motion(hair.values(), ts, Hybrid(28, 16), v0), hair.slide(hair.values(), ts, v0)
    np.testing.assert_allclose(motion.x, expected.x, rtol=0, atol=TENTH_OF_A_NANOMETRE)
    assert int(motion.n_half_cycles) == expected.times.size


@pytest.mark.slow
@pytest.mark.parametrize("hair", [HAIRS[1], HAIRS[6]], ids=str)
def test_derivatives_of_a_start_by_a_hair(hair: Hair):
    ts = np.linspace(0, 0.1, 41)[1:]
    point = hair.values()
    assert np.isfinite(hair.motion(point, ts, Hybrid(28, 16)).stats["t_handover"])
    jacobian = slopes(jnp.asarray(point), jnp.asarray(hair.exponent), ts, Hybrid(48, 16)).T
    steps = differences(lambda p: hair.slide(p, ts).x, point, np.array([2e-6, 2e-6, 2e-6, 2e-6, 1e-3, 2e-6, 2e-6]))
    assert_equal_slopes(jacobian * point[:, None], steps, 1e-5)


@pytest.mark.slow
def test_a_campaign_of_random_starts():
    rng, ts = np.random.default_rng(5), np.linspace(0, 0.3, 61)
    count = 24
    ratio, v_stribeck = rng.uniform(1, 2, count), 10 ** rng.uniform(-3.7, -2.3, count)
    mu, x0 = 10 ** rng.uniform(-1.7, -1, count), rng.uniform(1e-4, 2e-3, count)
    v0, exponent = np.where(rng.random(count) < 0.6, 0.0, 0.05 * rng.normal(size=count)), rng.choice([1.0, 2.0], count)

    def run(mu, mu_s, v_stribeck, exponent, x0, v0):
        machine = Oscillator(M, K, C, N, Stribeck(mu, mu_s, v_stribeck, exponent))
        return simulate(machine, x0, ts, v0=v0, engine=Hybrid(28, 32))

    motions = jax.jit(jax.vmap(run))(mu, ratio * mu, v_stribeck, exponent, x0, v0)
    for i in range(count):
        values = np.array([mu[i], ratio[i] * mu[i], v_stribeck[i], x0[i], C, K, M])
        expected = Hair(exponent[i], 0, 0, 0, False).slide(values, ts, v0[i])
        np.testing.assert_allclose(motions.x[i], expected.x, rtol=0, atol=TENTH_OF_A_NANOMETRE)
        assert int(motions.n_half_cycles[i]) == (expected.times.size if np.isfinite(expected.t_stop) else -1)


@pytest.mark.slow
def test_heavy_drag_takes_the_first_half_cycle_in_time():
    ts, drag = np.linspace(0, 0.15, 151), 2.5e3
    motion = simulate(Oscillator(M, K, C, N, Coulomb(0.01) + QuadraticDrag(drag)), 2e-3, ts)
    plain = Machine(M, C, lambda x: K * x, lambda u: N * 0.01 + drag * u * u, N * 0.01)
    expected = slide(plain, 2e-3, 0.0, ts)
    assert motion.stats["t_handover"] == 0
    reached = np.isfinite(np.asarray(motion.x))
    assert is_successful(motion.result) and np.all(reached)
    np.testing.assert_allclose(motion.x, expected.x, rtol=0, atol=TENTH_OF_A_NANOMETRE)


def differences(f: Any, point: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Derivatives along each component, in units of its value.

    The error is of fourth order in the relative steps.
    """

    def along(direction: np.ndarray, h: float) -> np.ndarray:
        return (f(point * (1 + h * direction)) - f(point * (1 - h * direction))) / (2 * h)

    return np.array([(4 * along(d, h) - along(d, 2 * h)) / 3 for d, h in zip(np.eye(point.size), steps, strict=True)])


def assert_equal_slopes(jacobian: Any, expected: np.ndarray, tolerance: float) -> None:
    error = np.linalg.norm(jacobian - expected, axis=1) / np.linalg.norm(expected, axis=1)
    print(" ".join(f"{value:.1e}" for value in error))
    assert np.all(error < tolerance)
