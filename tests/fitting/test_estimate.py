"""The pure estimate against fits, refits and changed data."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.friction import Coulomb
from tests.machines import RIGS, displacement, oscillator

RIG = RIGS["sliding"]
TS = np.arange(2000) * 1.5e-4
SIGMA, HALF_CYCLES = 1e-9, 5
NAMES = ("mu", "damping", "stiffness")
CLEAN = displacement(RIG, "Coulomb", TS)
X = CLEAN + SIGMA * np.random.default_rng(0).standard_normal(TS.size)
TRUTH = oscillator(RIG, "Coulomb")


def start(stiffness=TRUTH.stiffness):
    """A machine with coefficients that are two percent off."""
    return fj.Oscillator(TRUTH.mass, stiffness, 1.02 * TRUTH.damping, TRUTH.normal_force, Coulomb(1.02 * RIG.mu))


@jax.jit
def estimated(x):
    # Times on the device are constants here, and jax.jit traces each operation on them.
    return fj.estimate(x, jnp.asarray(TS), start(), NAMES, half_cycles=HALF_CYCLES, sigma=SIGMA)


@jax.jit
def with_fixed_stiffness(stiffness):
    return fj.estimate(X, TS, start(stiffness), ["mu", "damping", "mass"], sigma=SIGMA).values["mu"]


@pytest.mark.slow
def test_it_is_the_fit_under_white_noise():
    found, fit = estimated(X), fj.fit(fj.Trace(TS, X), start(), NAMES, start="release", noise="white")
    assert bool(found.converged) and found.names == (*NAMES, "x0", "offset")
    for name in found.names:
        assert abs(float(found.values[name]) - fit.values[name]) < 1e-3 * fit.std_errors[name]
        # The fit estimates the noise level from the record, with an error of 2 %.
        assert float(found.std_errors[name]) == pytest.approx(fit.std_errors[name], rel=0.1)


def test_a_batch_of_records_gives_the_scatter_of_the_standard_errors():
    noise = np.random.default_rng(1).standard_normal((200, TS.size))
    found = jax.jit(jax.vmap(estimated))(jnp.asarray(CLEAN + SIGMA * noise))
    assert bool(jnp.all(found.converged))
    pulls = (found.values["mu"] - RIG.mu) / found.std_errors["mu"]
    # The standard error of a standard deviation from 200 records is 5 %.
    assert np.std(pulls) == pytest.approx(1.0, abs=0.2) and abs(np.mean(pulls)) < 0.3
    alone = estimated(CLEAN + SIGMA * noise[7])
    assert float(found.values["mu"][7]) == pytest.approx(float(alone.values["mu"]), rel=1e-9)


@pytest.mark.slow
def test_the_derivative_by_a_fixed_coefficient_is_that_of_refits():
    stiffness = float(TRUTH.stiffness)
    slope = float(jax.grad(with_fixed_stiffness)(stiffness))
    refits = float(with_fixed_stiffness(stiffness + 1) - with_fixed_stiffness(stiffness - 1)) / 2
    assert slope == pytest.approx(refits, rel=1e-4)


def test_the_derivative_by_the_data_is_that_of_refits():
    slopes = jax.grad(lambda x: estimated(x).values["mu"])(jnp.asarray(X))
    for i in (3, 400, 1000):
        step = 1e-7 * (np.arange(X.size) == i)
        refits = float(estimated(X + step).values["mu"] - estimated(X - step).values["mu"]) / 2e-7
        assert float(slopes[i]) == pytest.approx(refits, rel=1e-4)


@pytest.mark.slow
def test_masked_samples_do_not_count():
    used = np.arange(TS.size) % 7 != 3
    with_gaps = np.where(used, X, np.nan)
    found = fj.estimate(with_gaps, TS, start(), NAMES, half_cycles=HALF_CYCLES, sigma=SIGMA, mask=used)
    fewer = fj.estimate(X[used], TS[used], start(), NAMES, half_cycles=HALF_CYCLES, sigma=SIGMA)
    for name in found.names:
        assert abs(float(found.values[name] - fewer.values[name])) < 1e-4 * float(fewer.std_errors[name])
    assert float(found.chi2) == pytest.approx(float(fewer.chi2))


@pytest.mark.slow
def test_a_wrong_number_of_half_cycles_has_not_converged():
    wrong = fj.estimate(X, TS, start(), NAMES, half_cycles=HALF_CYCLES - 2, sigma=SIGMA)
    assert not bool(wrong.converged)


@pytest.mark.slow
def test_a_solver_of_optimistix_finds_the_same():
    solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
    found = fj.estimate(X, TS, start(), NAMES, half_cycles=HALF_CYCLES, sigma=SIGMA, solver=solver)
    expected = estimated(X)
    for name in found.names:
        assert abs(float(found.values[name] - expected.values[name])) < 1e-3 * float(expected.std_errors[name])


@pytest.mark.parametrize(
    ("names", "options", "text"),
    [
        (["mux"], {}, "no coefficient 'mux'"),
        ([], {}, "at least one"),
        (["mu", "mu"], {}, "named twice in free"),
        (["mu"], {"nuisance": ["x0", "x0"]}, "named twice in nuisance"),
        (["mu", "normal_force"], {}, "product"),
        (["mu"], {"nuisance": ["t_release"]}, "nuisance"),
    ],
)
def test_names_are_checked(names, options, text):
    with pytest.raises(UsageError, match=text):
        fj.estimate(X, TS, start(), names, **options)


def test_shapes_are_checked():
    with pytest.raises(ValueError, match=r"\(1999,\) and \(2000,\)"):
        fj.estimate(X[1:], TS, start(), NAMES)


@pytest.mark.parametrize("kind", ["velocity", "acceleration"])
def test_velocities_and_accelerations_are_estimated(kind):
    """Bias and drift are estimated with the coefficients."""
    true = fj.Oscillator(0.1, 1000.0, damping=0.05, normal_force=10.0, friction=fj.friction.Coulomb(0.01))
    start = fj.Oscillator(0.1, 1000.0, damping=0.052, normal_force=10.0, friction=fj.friction.Coulomb(0.0101))
    ts, sigma = np.linspace(1e-4, 0.25, 501), {"velocity": 1e-5, "acceleration": 1e-3}[kind]
    observation = fj.Observation(kind)
    reading = np.asarray(fj.observe(true, fj.simulate(true, 2e-3, ts), observation))
    y = reading + 0.01 + 0.002 * ts + sigma * np.random.default_rng(0).standard_normal(ts.size)
    # An acceleration jumps at the reversals, every pi/omega.
    kept = np.abs(np.sin(np.sqrt(1e4 - 0.25**2) * ts)) > 0.1
    nuisance = ("x0", "offset", "drift")
    found = fj.estimate(
        y, ts, start, ["mu", "damping"], x0=2e-3, sigma=sigma, nuisance=nuisance, observation=kind, mask=kept
    )
    for name, value in {"mu": 0.01, "damping": 0.05, "x0": 2e-3, "offset": 0.01, "drift": 0.002}.items():
        assert abs(found.values[name] - value) < 4 * found.std_errors[name], name
    assert bool(found.converged)
    with pytest.raises(fj.errors.UsageError, match=f"A {kind} does not show the displacement at time zero: give x0"):
        fj.estimate(y, ts, start, ["mu"], observation=kind)
