"""Fits on a moving floor with recorded acceleration."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import DataError, UsageError
from fricjax.fitting import fit_on_moving_floor
from fricjax.oscillator import simulate
from tests.machines import MACHINE, RIGS, oscillator

pytestmark = pytest.mark.slow

SLIDING = oscillator(RIGS["sliding"], "Coulomb")
RATE, NOISE = 5e3, 1e-9


@pytest.fixture(scope="module")
def shaken() -> tuple[fj.Trace, np.ndarray]:
    """Run on a floor of vibration class C at 12.6 Hz."""
    random, t = np.random.default_rng(0), np.arange(round(0.45 * RATE)) / RATE
    floor = np.sqrt(3.4e-7 * RATE / 2) * random.standard_normal(t.size)
    x = np.asarray(simulate(SLIDING, 2e-3, t, base_acceleration=floor).x)
    return fj.Trace(t, x + NOISE * random.standard_normal(t.size), sigma=NOISE), floor


def test_what_the_floor_did_is_taken_out(shaken: tuple[fj.Trace, np.ndarray]):
    trace, floor = shaken
    plain = fj.fit(trace, SLIDING, MACHINE, throw=False)
    found = fit_on_moving_floor(trace, floor, SLIDING, MACHINE)
    # Without the floor's record the fit detects the vibration and reports larger errors.
    assert abs(plain.values["mu"] - 0.05) < 4 * plain.std_errors["mu"] and plain.chi2_reduced > 1e3
    assert plain.noises[0].floor > 0 and plain.std_errors["mu"] > 1e3 * found.std_errors["mu"]
    assert abs(found.values["mu"] - 0.05) < 5 * found.std_errors["mu"]
    assert found.values["mu"] == pytest.approx(0.05, rel=1e-6)
    assert found.chi2_reduced == pytest.approx(1, abs=0.15)


def test_a_still_floor_changes_nothing(shaken: tuple[fj.Trace, np.ndarray]):
    run = fj.synthetic_run(SLIDING, 2e-3, rate=RATE, duration=0.45, noise=NOISE)
    still = fit_on_moving_floor(run, np.zeros(run.trace.n), SLIDING, MACHINE)
    assert still.values["mu"] == pytest.approx(fj.fit(run, SLIDING, MACHINE).values["mu"], abs=1e-13)


def test_an_acceleration_that_does_not_fit(shaken: tuple[fj.Trace, np.ndarray]):
    trace, floor = shaken
    with pytest.raises(UsageError, match=r"one number per sample, 2250 of them, got an array of shape \(3,\)"):
        fit_on_moving_floor(trace, floor[:3], SLIDING, MACHINE)
    with pytest.raises(DataError, match=r"base_acceleration\[7\] is nan"):
        fit_on_moving_floor(trace, np.where(np.arange(floor.size) == 7, np.nan, floor), SLIDING, MACHINE)
