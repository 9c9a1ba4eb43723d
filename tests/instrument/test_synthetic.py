"""Synthetic runs: reproducibility, metadata, effects and error messages."""

import inspect
import json
import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.friction import Coulomb, LuGre, QuadraticDrag, Tanh
from fricjax.instrument import Interferometer, synthetic_run
from fricjax.oscillator import Oscillator, restoring, simulate
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

pytestmark = pytest.mark.slow

ROLLING = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 1.89, Coulomb(0.01))
EVERYTHING = {
    "noise": 2e-9,
    "quantisation": 3e-10,
    "offset": 1e-6,
    "drift": 1e-8,
    "hold": 0.05,
    "release_time_constant": 1e-3,
    "periodic_nonlinearity": (2e-9, 0.7e-9),
    "wavelength": 632.99e-9,
    "passes": 2,
    "floor_acceleration_psd": 3.4e-7,
    "sampling_jitter": 2e-8,
    "scale_error": 1e-7,
}


def run(oscillator=ROLLING, x0=2e-3, **keywords):
    return synthetic_run(oscillator, x0, **{"rate": 5e3, "duration": 0.4, **keywords})


def test_the_same_seed_gives_the_same_run():
    first, second, other = (run(seed=seed, **EVERYTHING) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.trace.x, second.trace.x)
    assert first.meta == second.meta
    assert np.std(first.trace.x - other.trace.x) > 1e-9


def test_random_effects_draw_from_streams_of_their_own():
    clean, noisy = run(noise=0.0).trace.x, run(noise=1e-9).trace.x
    shaken, both = (run(noise=std, floor_acceleration_psd=3.4e-7).trace.x for std in (0.0, 1e-9))
    np.testing.assert_allclose(both - shaken, noisy - clean, rtol=0, atol=1e-17)
    late, late_noisy = (run(noise=std, sampling_jitter=1e-7).trace.x for std in (0.0, 1e-9))
    np.testing.assert_allclose(late_noisy - late, noisy - clean, rtol=0, atol=1e-17)
    noise, jitter = (noisy - clean) / 1e-9, late - clean
    assert abs(np.corrcoef(noise, jitter)[0, 1]) < 5 / np.sqrt(noise.size)


def test_without_effects_it_is_the_motion_itself():
    record = run(noise=0.0)
    np.testing.assert_allclose(record.trace.t, np.arange(2000) / 5e3, rtol=1e-15)
    np.testing.assert_array_equal(record.trace.x, np.asarray(simulate(ROLLING, 2e-3, record.trace.t).x))
    assert record.trace.sigma is None


def test_the_hold_moves_the_release():
    record = run(noise=0.0, hold=0.1)
    t = np.asarray(record.trace.t)
    assert record.release == 0.1
    assert np.all(record.trace.x[t <= 0.1] == 2e-3)
    moving = np.asarray(simulate(ROLLING, 2e-3, t[t > 0.1] - 0.1).x)
    np.testing.assert_allclose(record.trace.x[t > 0.1], moving, rtol=0, atol=1e-14)


def test_an_overdamped_mass_creeps_to_its_dead_band():
    slow, fast = 20.0, 500.0
    machine = Oscillator(1.0, slow * fast, slow + fast, 2.0, Coulomb(0.1))
    record = synthetic_run(machine, 2e-3, rate=5e3, duration=0.2, noise=0.0)
    t, band = np.asarray(record.trace.t), 0.2 / (slow * fast)
    decay = (fast * np.exp(-slow * t) - slow * np.exp(-fast * t)) / (fast - slow)
    np.testing.assert_allclose(record.trace.x, band + (2e-3 - band) * decay, rtol=0, atol=1e-10)


def test_a_kick_at_release():
    t = np.arange(2000) / 5e3
    np.testing.assert_array_equal(run(noise=0.0, v0=-0.05).trace.x, np.asarray(simulate(ROLLING, 2e-3, t, v0=-0.05).x))


def test_meta_holds_all_that_makes_the_run_again():
    record = run(seed=7, **EVERYTHING)
    meta = json.loads(json.dumps(record.meta))
    given = {**EVERYTHING, "periodic_nonlinearity": [2e-9, 0.7e-9]}
    assert meta["parameters"] == given | {"x0": 2e-3, "v0": 0.0, "rate": 5e3, "duration": 0.4, "seed": 7}
    machine = meta["coefficients"]
    assert machine["mu"] == 0.01
    oscillator = Oscillator(
        machine["mass"], machine["stiffness"], machine["damping"], machine["normal_force"], Coulomb(machine["mu"]),
        drag=machine["drag"],
    )  # fmt: skip
    np.testing.assert_array_equal(synthetic_run(oscillator, **meta["parameters"]).trace.x, record.trace.x)
    assert (meta["quantity"], meta["release_time"], meta["friction"]) == ("m", 0.05, "Coulomb")


def test_the_log_has_a_step_per_effect():
    names = [step.name for step in run(**EVERYTHING).log]
    order = ["motion", "release", "floor_motion", "sampling_jitter", "scale_error", "offset", "drift"]
    assert names == [*order, "periodic_nonlinearity", "noise", "quantisation"]
    assert [step.name for step in run(noise=0.0).log] == ["motion"]


def test_sigma_is_that_of_the_reading():
    record = run(noise=1e-9, quantisation=2e-9)
    assert float(np.asarray(record.trace.sigma)) == pytest.approx(np.sqrt(1 + 4 / 12) * 1e-9, rel=1e-12)
    scatter = np.std(record.trace.x - run(noise=0.0).trace.x)
    assert scatter == pytest.approx(float(np.asarray(record.trace.sigma)), rel=0.08)


def test_names_and_units_of_other_rigs():
    laws = Coulomb(0.002) + QuadraticDrag(0.01)
    swing = Oscillator(1.0, 30.0, 0.01, 1.0, laws, restoring=restoring.Pendulum())
    record = synthetic_run(swing, 0.3, rate=200, duration=1.0, noise=1e-4, release_time_constant=1e-3)
    assert record.quantity == "rad"
    assert record.meta["friction"] == "Coulomb + QuadraticDrag"
    assert {"mu", "quadratic_drag", "mass", "drag"} <= set(record.meta["coefficients"])
    twice = Oscillator(1.0, 30.0, 0.01, 1.0, Coulomb(0.002) + Coulomb(0.001))
    record = synthetic_run(twice, 1e-3, rate=200, duration=1.0, release_time_constant=1e-3)
    assert {"friction.0.mu", "friction.1.mu"} <= set(record.meta["coefficients"])


@pytest.mark.parametrize("law", [Tanh(0.01, 1e-3), LuGre(0.01, sigma0=1e5, sigma1=1.0)], ids=["tanh", "lugre"])
def test_laws_without_a_jump_take_the_same_drive(law):
    oscillator = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 1.89, law)
    released: dict[str, Any] = {"duration": 0.3, "noise": 0.0, "hold": 0.02, "release_time_constant": 1e-3}
    shaken = run(oscillator, floor_acceleration_psd=3.4e-4, **released).trace.x
    sharp, still = (run(floor_acceleration_psd=density, **released).trace.x for density in (3.4e-4, 0.0))
    # The same floor moves all of them. They differ by their contacts, not by the floor motion.
    assert np.abs(sharp - still).max() > 2e-5
    assert np.abs(shaken - sharp).max() < 3e-6


@given(factor=st.floats(0.1, 10.0), seed=st.integers(0, 100))
@settings(max_examples=10)
def test_only_ratios_of_forces_show(factor, seed):
    """Scale m, k, c and N of a driven run."""
    scaled = Oscillator(
        factor * PROTOTYPE_MASS, factor * 2574.0, factor * PROTOTYPE_DAMPING, factor * 1.89, Coulomb(0.01)
    )
    keywords = {"seed": seed, "release_time_constant": 1e-3, "floor_acceleration_psd": 3.4e-7}
    np.testing.assert_allclose(run(scaled, **keywords).trace.x, run(**keywords).trace.x, rtol=0, atol=1e-11)


@given(factor=st.floats(0.2, 5.0), seed=st.integers(0, 100))
@settings(max_examples=10)
def test_lengths_scale_with_the_load(factor, seed):
    """Scale x0, N, noise, floor acceleration and displacement by one factor."""
    wide = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, factor * 1.89, Coulomb(0.01))
    keywords = {"seed": seed, "release_time_constant": 1e-3}
    one = run(noise=1e-9, floor_acceleration_psd=3.4e-7, **keywords).trace.x
    many = run(wide, factor * 2e-3, noise=factor * 1e-9, floor_acceleration_psd=factor**2 * 3.4e-7, **keywords).trace.x
    np.testing.assert_allclose(many / factor, one, rtol=0, atol=2e-10)


def test_a_pull_from_the_other_side_is_the_mirror_image():
    right, left = (run(x0=x0, noise=0.0, release_time_constant=1e-3, hold=0.01) for x0 in (2e-3, -2e-3))
    np.testing.assert_allclose(left.trace.x, -right.trace.x, rtol=0, atol=1e-15)


def test_ten_thousand_samples_take_no_second():
    keywords = {**EVERYTHING, "duration": 2.0}
    run(**keywords)
    begin = time.perf_counter()
    run(**keywords)
    assert time.perf_counter() - begin < 1.0


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"noise": -1e-9}, r"noise must not be negative, got -1e-09 m"),
        ({"quantisation": float("nan")}, "quantisation must be a finite number of m, got nan"),
        ({"rate": 0}, "rate must be a positive number of Hz, got 0"),
        ({"duration": -1.0}, "duration must be a positive number of s, got -1"),
        ({"rate": 10.0, "duration": 0.2}, "has 2 samples, and at least 3 are needed; make rate or duration larger"),
        ({"hold": 0.5}, "hold is 0.5 s, but the whole run lasts 0.4 s"),
        ({"hold": -0.1}, "hold must not be negative"),
        ({"floor_acceleration_psd": -1.0}, "floor_acceleration_psd must not be negative"),
        ({"periodic_nonlinearity": (1e-9, 1e-9, 1e-9)}, "periodic_nonlinearity must be one or two numbers of m, got 3"),
        ({"passes": 3}, r"passes must be 1 \(single pass\) or 2 \(double pass\), got 3"),
        ({"wavelength": 0.0}, "wavelength must be a positive number of m"),
        ({"x0": "far"}, "x0 must be one number of m, got 'far'"),
        ({"seed": -1}, "seed must be a whole number, zero or more, got -1"),
        ({"seed": 1.5}, "seed must be a whole number"),
        ({"quantization": 1e-9}, "no keyword 'quantization'. Did you mean 'quantisation'"),
        ({"release_time": 1e-3}, "no keyword 'release_time'. Did you mean 'release_time_constant'"),
    ],
)
def test_bad_input_gets_one_sentence(keywords, message):
    with pytest.raises(UsageError, match=message):
        run(**keywords)


def test_a_batch_of_oscillators_is_refused():
    batch = Oscillator(PROTOTYPE_MASS, 2574.0, 0.1, 1.89, Coulomb(np.array([0.01, 0.02])))
    with pytest.raises(UsageError, match="mu must be one number"):
        run(batch)


def test_the_root_exports_it_with_the_agreed_signature():
    assert fj.synthetic_run is synthetic_run
    names = inspect.signature(synthetic_run).parameters
    assert list(names)[:2] == ["oscillator", "x0"]
    assert {"rate", "duration", "noise", "seed", "v0", "instrument"} <= set(names)
    assert Interferometer().noise == names["noise"].default == 1e-9
