"""Decay of the holding force, from the first half-cycle of simulated runs."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import DataError
from fricjax.pairs.release import fit_release
from tests.machines import MACHINE, RIGS, oscillator

SLIDING = oscillator(RIGS["sliding"], "Coulomb")


def run(time_constant: float, seed: int, hold: float = 5e-3) -> fj.Record:
    return fj.synthetic_run(
        SLIDING, 2e-3, rate=10e3, duration=0.5, noise=1e-9, hold=hold, release_time_constant=time_constant, seed=seed
    )


@pytest.mark.slow
@pytest.mark.parametrize(("time_constant", "seed"), [(0.5e-3, 0), (1e-3, 1), (3e-3, 2)])
def test_the_release_is_found_within_its_uncertainty(time_constant: float, seed: int):
    record = run(time_constant, seed)
    found = fit_release(record, fj.fit(record, SLIDING, MACHINE))
    truth = {"time_constant": time_constant, "t_release": 5e-3, "x0": 2e-3}
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 4 * found.std_errors[name], name
    assert found.std_errors["time_constant"] < 1e-3 * time_constant
    assert 0.6 < found.chi2_reduced < 1.5
    assert "time_constant" in found.summary()


@pytest.mark.slow
def test_a_record_that_begins_at_a_reversal_cannot_tell():
    record = run(1e-3, 0)
    found = fj.fit(record, SLIDING, MACHINE)
    t, x = np.asarray(record.trace.t), np.asarray(record.trace.x)
    late = t > found.run_parameter("t_release") - 3e-4
    with pytest.raises(DataError, match="Record the run from before it"):
        fit_release(fj.Trace(t[late], x[late], sigma=1e-9), found)
