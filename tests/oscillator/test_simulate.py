"""`simulate`: choice of the engine and error messages."""

import subprocess
import sys
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Stribeck, Tanh
from fricjax.oscillator import (
    RESULTS,
    Exact,
    Hybrid,
    Motion,
    Oscillator,
    Smooth,
    is_successful,
    restoring,
    simulate,
    starting_state,
)
from fricjax.oscillator.select import select_engine
from tests.tiers import cases

TS = np.linspace(0, 0.3, 31)
OUTCOMES: Any = RESULTS  # an equinox enumeration; pyright does not know its members and texts
RIG = (1.0, 5000.0, 1.0, 9.81)


def words(motion: Motion) -> str:
    return OUTCOMES[motion.result]


@pytest.mark.parametrize(
    ("machine", "engine"),
    [
        (Oscillator(*RIG, Coulomb(0.1)), Exact),
        (Oscillator(*RIG, Coulomb(0.1, 0.2)), Exact),
        (Oscillator(*RIG, Coulomb(0.1), drag=0.1), Hybrid),
        (Oscillator(*RIG, Coulomb(0.1), restoring=restoring.Cubic(1e6)), Hybrid),
        (Oscillator(*RIG, Coulomb(0.1), restoring=restoring.Pendulum()), Hybrid),
        (Oscillator(*RIG, Stribeck(0.1, 0.2)), Hybrid),
        (Oscillator(*RIG, Coulomb(0.1) + QuadraticDrag(0.1)), Hybrid),
        (Oscillator(*RIG, Tanh(0.1, 1e-3)), Hybrid),
        (Oscillator(*RIG, Tanh(0.1, 1e-3) + QuadraticDrag(0.1)), Hybrid),
        (Oscillator(*RIG, LuGre(0.1)), Smooth),
        (Oscillator(*RIG, LuGre(0.1) + Tanh(0.1, 1e-3)), Smooth),
    ],
)
def test_auto_picks_the_fastest_engine_that_can(machine: Oscillator, engine: type):
    assert type(select_engine("auto", machine)) is engine


@pytest.mark.slow
def test_the_motion_says_which_engine_made_it():
    for name in ("exact", "hybrid"):
        motion = simulate(Oscillator(*RIG, Coulomb(0.1)), 1e-3, TS, engine=name)
        assert motion.engine == name
        assert is_successful(motion.result)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ts": np.zeros((2, 2))}, r"ts must be a list of at least one time \[s\], got an array of shape \(2, 2\)"),
        ({"ts": np.zeros(0)}, r"got an array of shape \(0,\)"),
        ({"ts": np.array([0.0, 0.2, 0.1])}, "ts must increase from sample to sample"),
        ({"ts": np.array([0.0, np.nan, 0.1])}, "ts must increase from sample to sample"),
        (
            {"engine": "hybird"},
            r"There is no engine 'hybird'\. Did you mean 'hybrid'\? Choose one of auto",
        ),
        ({"engine": "smooth"}, "cannot integrate the jump of Coulomb. Use the exact or the hybrid engine"),
        ({"x0": np.array([1e-3, 2e-3])}, r"x0 must be one number, got shape \(2,\). For several starts use jax.vmap"),
        ({"v0": np.zeros(1)}, r"v0 must be one number, got shape \(1,\)"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict, message: str):
    given = {"x0": 1e-3, "ts": TS, **arguments}
    with pytest.raises(ValueError, match=message):
        simulate(Oscillator(*RIG, Coulomb(0.1)), **given)


@pytest.mark.parametrize(
    ("machine", "engine", "message"),
    [
        (Oscillator(*RIG, Stribeck(0.1)), "exact", "knows Coulomb friction only, not Stribeck"),
        (Oscillator(*RIG, Coulomb(0.1), drag=0.1), "exact", "has no quadratic drag, but drag is 0.1"),
        (
            Oscillator(*RIG, Coulomb(0.1), restoring=restoring.Pendulum()),
            "exact",
            "knows the linear spring only, not Pendulum",
        ),
        (
            Oscillator(*RIG, LuGre(0.1)),
            "hybrid",
            "integrates laws without internal states, and LuGre has some. Use the smooth engine",
        ),
    ],
)
def test_an_engine_says_what_it_cannot_do(machine: Oscillator, engine: str, message: str):
    with pytest.raises(ValueError, match=message):
        simulate(machine, 1e-3, TS, engine=engine)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((-1.0, 5000.0, 0.0, 1.0), "mass must be a positive number of kg, got -1.0"),
        ((0.0, 5000.0, 0.0, 1.0), "mass must be a positive number of kg, got 0.0"),
        ((1.0, np.nan, 0.0, 1.0), "stiffness must be a positive number of N/m, got nan"),
        ((1.0, 5000.0, 0.0, -2.0), "normal_force must not be negative, got -2.0 N"),
    ],
)
def test_an_impossible_machine_is_refused(values: Any, message: str):
    with pytest.raises(ValueError, match=message):
        Oscillator(values[0], values[1], values[2], values[3], Coulomb(0.1))


def test_single_precision_is_refused_with_the_remedy():
    code = (
        "import fricjax.oscillator as o, fricjax.friction as f\n"
        "try: o.simulate(o.Oscillator(1.0, 1.0, 0.0, 1.0, f.Coulomb(0.1)), 1.0, 1.0)\n"
        "except RuntimeError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "JAX is set to single" in done.stdout
    assert 'jax.config.update("jax_enable_x64", True)' in done.stdout


@pytest.mark.slow
def test_more_half_cycles_than_provided_for():
    machine = Oscillator(*RIG, Stribeck(0.01, 0.02))
    motion = simulate(machine, 3e-3, TS, engine=Hybrid(max_half_cycles=3))
    assert motion.result == RESULTS.too_many_half_cycles
    assert "max_half_cycles" in words(motion)
    reached = 3 * np.pi / np.sqrt(5000.0) > TS
    assert np.all(np.isfinite(motion.x[reached]))
    assert np.all(np.isnan(motion.x[~reached]))
    assert motion.n_half_cycles == -1


@pytest.mark.parametrize("law", [Coulomb(0.05), pytest.param(Stribeck(0.05, 0.06, 1e-3), marks=pytest.mark.slow)])
def test_a_long_rest_takes_no_memory(law):
    machine = Oscillator(0.41, 2574.0, 0.17, 9.66, law)
    motion, short = (simulate(machine, 2e-3, np.array([0.0, end])) for end in (1e7, 1.0))
    assert motion.turning_points.size <= 512
    assert int(motion.n_half_cycles) == int(short.n_half_cycles) == 5
    assert float(motion.x[-1]) == pytest.approx(float(short.x[-1]), rel=1e-12)


def test_overdamped():
    machine = Oscillator(1.0, 5000.0, 200.0, 9.81, Coulomb(0.1))
    motion = simulate(machine, 3e-3, TS)
    assert motion.result == RESULTS.overdamped
    assert "damping ratio is one or more" in words(motion)
    assert np.all(np.isnan(motion.x))
    hybrid = simulate(machine, 3e-3, TS, engine="hybrid")
    assert not is_successful(hybrid.result)
    assert "does not reach its reversal" in words(hybrid)
    assert np.all(np.isnan(hybrid.x[1:]))


@pytest.mark.slow
def test_drag_hidden_from_the_exact_engine_is_told_in_its_result():
    def run(drag):
        return simulate(Oscillator(*RIG, Coulomb(0.1), drag=drag), 3e-3, TS, engine="exact")

    motion = jax.vmap(run)(jnp.asarray([0.0, 0.5]))
    assert [bool(ok) for ok in motion.result == RESULTS.successful] == [True, False]
    assert np.all(np.isfinite(motion.x[0])) and np.all(np.isnan(motion.x[1]))
    slope = jax.jvp(run, (jnp.zeros(()),), (jnp.ones(()),))[1]
    assert np.all(np.isnan(slope.x)) and np.all(np.isnan(slope.turning_points)) and np.isnan(slope.t_stop)


def test_a_jitted_call_takes_times_as_constants():
    for ts in (TS, jnp.asarray(TS)):
        jitted = jax.jit(lambda x0, ts=ts: simulate(Oscillator(*RIG, Coulomb(0.1)), x0, ts).x)
        np.testing.assert_allclose(jitted(1e-3), simulate(Oscillator(*RIG, Coulomb(0.1)), 1e-3, TS).x, atol=1e-17)


ENGINES = {"exact": Coulomb(0.1, 0.12), "hybrid": Stribeck(0.1, 0.12, 0.02), "smooth": Tanh(0.1, 0.01)}


@pytest.mark.parametrize("engine", cases(ENGINES, ["exact"]))
def test_vmap_equals_a_loop(engine: str):
    machine = Oscillator(*RIG, ENGINES[engine])
    leaves, structure = jax.tree.flatten(machine)
    factor = np.array([0.9, 1.0, 1.1])
    x0 = 2e-3 * factor

    def run(values, x):
        return simulate(jax.tree.unflatten(structure, values), x, TS, engine=engine)

    used = [i for i, leaf in enumerate(leaves) if leaf != 0]
    # One lane per start, and one per leaf and factor. In the latter, only that leaf differs from the machine.
    lanes = [([*leaves], x) for x in x0]
    lanes += [([leaf * (f if i == j else 1) for j, leaf in enumerate(leaves)], x0[1]) for i in used for f in factor]
    stacked = [jnp.stack([lane[j] for lane, _ in lanes]) for j in range(len(leaves))]
    together = jax.vmap(run)(stacked, jnp.asarray([x for _, x in lanes])).x
    tolerance = {"exact": 1e-16, "hybrid": 1e-15, "smooth": 1e-11}[engine]
    for i, (lane, x) in enumerate(lanes):
        alone = run([jnp.asarray(value) for value in lane], jnp.asarray(x)).x
        np.testing.assert_allclose(together[i], alone, rtol=0, atol=tolerance)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_second_run_of_the_same_shape_compiles_nothing(engine: str, caplog: pytest.LogCaptureFixture):
    def run(mu: float, x0: float):
        law = eqx.tree_at(lambda law: law.mu, ENGINES[engine], np.asarray(mu))
        return simulate(Oscillator(*RIG, law), x0, TS, engine=engine).x

    run(0.1, 2e-3)
    with jax.log_compiles(True):
        run(0.11, 2.1e-3).block_until_ready()
    assert not caplog.records


def test_another_shape_does_compile_and_the_log_shows_it(caplog: pytest.LogCaptureFixture):
    with jax.log_compiles(True):
        simulate(Oscillator(*RIG, Coulomb(0.1)), 2e-3, np.linspace(0, 0.2, 7))
    assert caplog.records


def test_bristles_start_bent_by_a_slow_pull_with_finite_derivatives():
    values, structure = jax.tree.flatten(Oscillator(*RIG, LuGre(0.1, 0.15, 5e-3, sigma0=1e4)))

    def bend(values, x0):
        return starting_state(jax.tree.unflatten(structure, values), x0, 0.0).state

    for side in (-1.0, 1.0):
        np.testing.assert_allclose(bend(values, side * 1e-3), [side * 0.1 * 9.81 / 1e4], rtol=1e-14)
    slopes = jax.jacfwd(bend)([jnp.asarray(value) for value in values], 1e-3)
    assert np.all(np.isfinite(slopes))


def test_a_mesh_of_more_nodes_for_more_accuracy():
    machine = Oscillator(*RIG, Stribeck(0.1, 0.12))
    engines: list[Any] = [select_engine("hybrid", machine, accuracy=a) for a in (1e-8, 1e-10, 1e-12)]
    nodes = [engine.nodes for engine in engines]
    assert nodes[0] < nodes[1] < nodes[2]


def test_friction_force_opposes_the_motion():
    for engine, law in ENGINES.items():
        motion = simulate(Oscillator(*RIG, law), 2e-3, TS, engine=engine)
        moving = np.asarray(np.abs(motion.v) > 1e-4)
        assert np.all(np.asarray(motion.friction_force * motion.v)[moving] > 0)


def test_a_text_is_no_coefficient():
    with pytest.raises(ValueError, match="must be a number in SI units, got the text '1 kg'"):
        Oscillator("1 kg", *RIG[1:], Coulomb(0.1))  # type: ignore[arg-type]


def test_an_oscillator_shows_its_values():
    assert "friction=Coulomb(mu=array(0.1))" in repr(Oscillator(*RIG, Coulomb(0.1)))
