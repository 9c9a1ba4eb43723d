"""Propagation of deviations through a decay, and records from a vibrating floor."""

import numpy as np
import pytest

from fricjax import Oscillator, Record, Trace, fit, simulate
from fricjax.fitting.floor import passage_of
from fricjax.fitting.solve import solve
from fricjax.friction import Coulomb, Stribeck
from fricjax.instrument import white_acceleration
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS

MODEL = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.05))
T = np.arange(8000) / 2e4
FLOOR = 3e-11
ROLLING = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 1.89, Coulomb(0.02))


def at_rows(model: Oscillator = MODEL):
    """Solve a run and return it with instants behind its first reversal."""
    clean = np.asarray(simulate(model, 2e-3, T).x)
    problem = problem_of(Trace(T, clean + 1e-9 * np.random.default_rng(0).standard_normal(T.size)), model, MACHINE)
    solution = solve(problem)
    first = float(solution.derived.values[problem.names.index("t_release")])
    t = np.linspace(first + 1e-3, 0.38 - problem.windows[0].origin, 200)
    return problem, solution, first, t


# The last stroke of the second law is slow throughout, and its friction falls with velocity there.
STRIBECK = Stribeck(0.05, mu_s=0.065, v_stribeck=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "within"), [(Coulomb(0.05), 1e-2), (STRIBECK, 8e-2)], ids=["coulomb", "stribeck"])
@pytest.mark.parametrize("deviation", [(1.0, 0.0), (0.0, 80.0)], ids=["position", "velocity"])
def test_a_deviation_goes_on_as_the_motion_deviates(deviation, law, within):
    """Follow a deviation from mid-stroke through delayed reversals to the stop."""
    model = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, law)
    problem, solution, first, t = at_rows(model)
    t = t[t > first + 0.02]
    passage = passage_of(problem, solution, 0, t)
    assert passage is not None
    begin, small = float(solution.derived.values[problem.names.index("x0")]), 1e-8
    at = simulate(model, begin, np.array([0.0, t[0] - first]))
    x, v = float(at.x[1]), float(at.v[1])
    base = np.asarray(simulate(model, x, t - t[0], v0=v).x)
    moved = np.asarray(simulate(model, x + small * deviation[0], t - t[0], v0=v + small * deviation[1]).x)
    state, expected = np.array(deviation), (moved - base) / small
    found = [deviation[0]]
    for carried in passage.matrix[1:]:
        state = carried @ state
        found.append(state[0])
    assert np.max(np.abs(expected)) > 0.7 and found == pytest.approx(expected, abs=within)
    assert found[-1] == found[-20]


def test_kicks_add_up_as_their_integral_says():
    """Integrate the effect of kicks on the state after a step."""
    problem, solution, _, t = at_rows()
    passage = passage_of(problem, solution, 0, t)
    assert passage is not None
    step, rate = t[11] - t[10], np.sqrt(STIFFNESS / PROTOTYPE_MASS)
    s = (np.arange(2000) + 0.5) / 2000 * step
    made = np.stack([np.sin(rate * s) / rate, np.cos(rate * s)]) * np.exp(-PROTOTYPE_DAMPING / PROTOTYPE_MASS / 2 * s)
    made[1] -= PROTOTYPE_DAMPING / PROTOTYPE_MASS / 2 * made[0]
    expected = made @ made.T * step / 2000
    assert passage.noise[11] == pytest.approx(expected, rel=1e-3)
    assert not passage.noise[-1].any()


@pytest.mark.slow
def test_without_friction_a_deviation_swings_as_the_mass_does():
    """Use the frictionless machine, which is linear everywhere."""
    model = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.0))
    clean = np.asarray(simulate(model, 2e-3, T).x)
    run = Trace(T, clean + 1e-9 * np.random.default_rng(0).standard_normal(T.size))
    problem = problem_of(run, model, ("damping", "stiffness"))
    passage = passage_of(problem, solve(problem), 0, T[1000:2000])
    assert passage is not None and not passage.bend.any()
    state = np.array([1.0, 0.0])
    for carried in passage.matrix[1:]:
        state = carried @ state
    half, time = PROTOTYPE_DAMPING / PROTOTYPE_MASS / 2, T[1999] - T[1000]
    rate = np.sqrt(STIFFNESS / PROTOTYPE_MASS - half**2)
    swung = np.cos(rate * time) + half / rate * np.sin(rate * time)
    assert state[0] == pytest.approx(np.exp(-half * time) * swung, abs=1e-3)


def shaken(seed: int, least: float = 1.8e-3, most: float = 2.6e-3, t: np.ndarray = T) -> Trace:
    random = np.random.default_rng(seed)
    start, floor = random.uniform(least, most), white_acceleration(t.size, 2e4, FLOOR, random)
    motion = simulate(MODEL, start, t, base_acceleration=floor)
    return Trace(t, np.asarray(motion.x) + 1e-9 * random.standard_normal(t.size))


@pytest.mark.slow
def test_a_floor_that_shakes_is_told_by_the_record():
    found = [fit(shaken(seed), MODEL, MACHINE) for seed in range(12)]
    true = {"mu": 0.05, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}
    scores = np.array([[(f.values[name] - true[name]) / f.std_errors[name] for name in MACHINE] for f in found])
    densities = [f.noises[0].floor for f in found]
    assert np.exp(np.mean(np.log(densities))) == pytest.approx(FLOOR, rel=0.35)
    assert np.sqrt(np.mean(scores**2)) < 1.6 and np.max(np.abs(scores)) < 5
    # Standard errors for white noise would be far too small.
    assert all(f.std_errors["mu"] > 10 * f.white_std_errors["mu"] for f in found)
    assert "is floor vibration of" in found[0].summary()


@pytest.mark.slow
def test_a_long_rest_does_not_hide_a_floor():
    """Detect floor vibration with two half-cycles and a long rest.

    The fit explains most of the two half-cycles. The rest has many more rows than their residuals.
    """
    found = [fit(shaken(seed, 1.0e-3, 1.25e-3, np.arange(40000) / 2e4), MODEL, MACHINE) for seed in range(6)]
    assert all(f.half_cycles[0] == 2 for f in found)
    assert all(f.noises[0].floor == pytest.approx(FLOOR, rel=0.9) for f in found)


def on_strong_floor(seed: int) -> Record:
    """Rolling run on a floor of class VC-C.

    The floor moves with 12.5 um/s in each third of an octave from 1 to 80 Hz.
    """
    random, rate, n = np.random.default_rng(seed), 5e3, 15000
    frequency = np.fft.rfftfreq(n, 1 / rate)
    inside = (frequency >= 1) & (frequency <= 80)
    density = (2 * np.pi * 12.5e-6) ** 2 * frequency[inside] / (2 ** (1 / 6) - 2 ** (-1 / 6))
    spectrum = np.zeros(frequency.size, complex)
    spectrum[inside] = np.sqrt(density * rate * n / 4) * (random.standard_normal((inside.sum(), 2)) @ [1, 1j])
    t = np.arange(n) / rate
    motion = simulate(ROLLING, random.uniform(1.5e-3, 2.5e-3), t, base_acceleration=np.fft.irfft(spectrum, n))
    return Record(t, np.asarray(motion.x) + 5e-9 * random.standard_normal(n))


def rests(record: Record) -> np.ndarray:
    """Means of fifty samples of a rest, with noise below 1 nm."""
    rest = record.segmentation.rest
    assert rest is not None
    resting = record.x[record.t > rest + 0.05]
    return resting[: resting.size // 50 * 50].reshape(-1, 50).mean(axis=1)


def is_true_on_a_floor(record: Record) -> bool:
    found = fit(record, ROLLING, MACHINE, throw=False)
    seen = found.converged and found.noises[0].floor > 0
    return seen and abs(found.values["mu"] - 0.02) < 3 * found.std_errors["mu"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [6, 12])
def test_a_mass_that_slides_on_in_its_rest_hides_no_floor(seed: int):
    record = on_strong_floor(seed)
    assert np.ptp(rests(record)) > 3e-7
    assert is_true_on_a_floor(record)


@pytest.mark.slow
def test_kicks_that_add_up_are_no_force_that_the_model_lacks():
    """Fit a run with similar deviations in neighbouring half-cycles.

    A drag would explain most of them.
    """
    record = on_strong_floor(8)
    assert np.ptp(rests(record)) < 1e-8
    assert is_true_on_a_floor(record)
