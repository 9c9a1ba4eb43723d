"""Half-cycle engines against event-driven integration.

The reference is DOP853 with a relative tolerance of 1e-12.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, QuadraticDrag, Stribeck
from fricjax.oscillator import Exact, Hybrid, Motion, Oscillator, restoring, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import Machine, Slide, slide
from tests.tiers import cases

N_CASES = 30


def random_runs() -> dict[str, np.ndarray]:
    """Machines of all sizes; every second run starts in motion."""
    rng = np.random.default_rng(7)
    mass, omega = 10 ** rng.uniform(-2, 1, N_CASES), 10 ** rng.uniform(0.5, 2.5, N_CASES)
    zeta = np.where(np.arange(N_CASES) < 4, [-0.01], rng.uniform(0, 0.6, N_CASES))
    dead_band, ratio = 10 ** rng.uniform(-5, -3, N_CASES), rng.uniform(1, 2.5, N_CASES)
    load = 10 ** rng.uniform(-1, 1, N_CASES)
    mu = mass * omega**2 * dead_band / load
    return {
        "mass": mass,
        "stiffness": mass * omega**2,
        "damping": 2 * zeta * mass * omega,
        "load": load,
        "mu": mu,
        "mu_s": ratio * mu,
        "x0": rng.choice([-1, 1], N_CASES) * dead_band * ratio * rng.uniform(0.8, 12, N_CASES),
        "v0": np.where(np.arange(N_CASES) % 2, 0, omega * dead_band * rng.uniform(-8, 8, N_CASES)),
        "end": 14 * np.pi / omega,
    }


RUNS = random_runs()
FRACTIONS = np.linspace(0, 1, 101)[1:]


@pytest.fixture(scope="module")
def oracle() -> list[Slide]:
    def run(i: int) -> Slide:
        r = {name: float(values[i]) for name, values in RUNS.items()}
        force, spring = r["mu"] * r["load"], r["stiffness"]
        machine = Machine(r["mass"], r["damping"], lambda x: spring * x, lambda u: force, r["mu_s"] * r["load"])
        return slide(machine, r["x0"], r["v0"], FRACTIONS * r["end"])

    return [run(i) for i in range(N_CASES)]


@pytest.mark.parametrize(
    ("engine", "tolerance"),
    [(Exact(64), 3e-11), pytest.param(Hybrid(max_half_cycles=16), 1e-7, marks=pytest.mark.slow)],
)
def test_coulomb_and_viscous_friction(oracle: list[Slide], engine, tolerance: float):
    def run(r):
        machine = Oscillator(r["mass"], r["stiffness"], r["damping"], r["load"], Coulomb(r["mu"], r["mu_s"]))
        return simulate(machine, r["x0"], FRACTIONS * r["end"], v0=r["v0"], engine=engine)

    motions = jax.jit(jax.vmap(run))({name: jnp.asarray(values) for name, values in RUNS.items()})
    for i, expected in enumerate(oracle):
        reach = np.max(np.abs(expected.x))
        omega = np.sqrt(RUNS["stiffness"][i] / RUNS["mass"][i])
        n = expected.times.size
        np.testing.assert_allclose(motions.x[i], expected.x, rtol=0, atol=tolerance * reach)
        np.testing.assert_allclose(motions.v[i], expected.v, rtol=0, atol=100 * tolerance * reach * omega)
        np.testing.assert_allclose(
            motions.turning_points[i][1 : n + 1], expected.points, rtol=0, atol=tolerance * reach
        )
        assert motions.t_stop[i] == pytest.approx(expected.t_stop, rel=1e-10)
        assert int(motions.n_half_cycles[i]) == (n if np.isfinite(expected.t_stop) else -1)


M, K, C = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING
SLIDING = (0.05, 0.065, 5e-3)
PENDULUM = (0.01, 0.5, 2e-4)


def stribeck(u: float) -> float:
    return 9.66 * (0.05 + 0.015 * np.exp(-((u / 5e-3) ** 2)))


HYBRID = {
    "sliding": (
        Oscillator(M, K, C, 9.66, Stribeck(*SLIDING)),
        Machine(M, C, lambda x: K * x, stribeck, 9.66 * 0.065),
        [(2e-3, 0.0), (-1.5e-3, 0.08), (1e-3, 0.1), (2e-4, 0.05)],
    ),
    "drag and cubic spring": (
        Oscillator(M, K, C, 9.66, Stribeck(*SLIDING), drag=0.5, restoring=restoring.Cubic(3e8)),
        Machine(M, C, lambda x: K * x + 3e8 * x**3, stribeck, 9.66 * 0.065, drag=0.5),
        [(2e-3, 0.0), (-1.5e-3, -0.08)],
    ),
    "drag in a sum": (
        Oscillator(M, K, C, 9.66, Coulomb(0.03) + QuadraticDrag(0.5)),
        Machine(M, C, lambda x: K * x, lambda u: 9.66 * 0.03 + 0.5 * u * u, 9.66 * 0.03),
        [(2e-3, 0.0), (0.0, -0.15)],
    ),
    "pendulum": (
        Oscillator(*PENDULUM, 0.4, Coulomb(0.05), drag=5e-5, restoring=restoring.Pendulum()),
        Machine(0.01, 2e-4, lambda x: 0.5 * np.sin(x), lambda u: 0.02, 0.02, drag=5e-5),
        [(1.6, 0.0), (1.2, -3.0)],
    ),
}
# Largest error as a fraction of the first amplitude: 0.15 nm on 2 mm for the linear spring, as the engine promises.
HYBRID_TOLERANCE = {
    "sliding": 7.5e-8,
    "drag and cubic spring": 7.5e-8,
    "drag in a sum": 7.5e-8,
    "pendulum": 1e-7,
}


@eqx.filter_jit
def motions_of(machine: Oscillator, starts: jax.Array, ts: jax.Array, engine: Hybrid) -> Motion:
    """A motion from each displacement and velocity."""
    return jax.vmap(lambda start: simulate(machine, start[0], ts, v0=start[1], engine=engine))(starts)


@pytest.mark.slow
@pytest.mark.parametrize("name", cases(HYBRID, ["sliding"]))
def test_any_sliding_law_and_spring(name: str):
    machine, plain, starts = HYBRID[name]
    ts = np.linspace(0, 14 * np.pi * np.sqrt(machine.mass / machine.stiffness), 301)[1:]
    motions = motions_of(machine, jnp.asarray(starts), jnp.asarray(ts), Hybrid(max_half_cycles=32))
    for i, (x, v) in enumerate(starts):
        expected = slide(plain, x, v, ts)
        reach = np.max(np.abs(expected.x))
        np.testing.assert_allclose(motions.x[i], expected.x, rtol=0, atol=HYBRID_TOLERANCE[name] * reach)
        assert int(motions.n_half_cycles[i]) == (expected.times.size if np.isfinite(expected.t_stop) else -1)
        if np.isfinite(expected.t_stop):
            assert motions.t_stop[i] == pytest.approx(expected.t_stop, rel=1e-7)
            final = motions.turning_points[i][expected.times.size]
            assert final == pytest.approx(expected.points[-1], abs=HYBRID_TOLERANCE[name] * reach)


@pytest.mark.slow
def test_more_nodes_bring_the_hybrid_engine_closer():
    machine, plain, starts = HYBRID["sliding"]
    ts = np.linspace(0, 0.2, 301)[1:]
    expected = slide(plain, *starts[0], ts)
    # The second engine and its program are those of the motions above.
    engines = Hybrid(nodes=12, max_half_cycles=32), Hybrid(max_half_cycles=32)
    found = [motions_of(machine, jnp.asarray(starts), jnp.asarray(ts), engine).x[0] for engine in engines]
    errors = [float(np.max(np.abs(x - expected.x))) for x in found]
    assert errors[0] > 8 * errors[1]
