"""Standard errors of sparse and incomplete records are those of their samples."""

from pathlib import Path

import numpy as np
import pytest

from fricjax import Oscillator, Record, data, fit, read
from fricjax.friction import Coulomb
from tests.tiers import cases

FREE = ("mu", "damping", "stiffness")
MACHINE = Oscillator(0.41068, 2574.0, 0.17557, 9.66, Coulomb(0.02))
NOISE = 5e-9


@pytest.fixture(scope="module")
def record():
    return read(data.example_paths().run)


def test_residuals_show_the_noise_of_a_sparse_record(record):
    sparse = Record(record.t[::24], record.x[::24])
    # With seven samples per half-cycle, differences of neighbouring samples contain the motion.
    assert sparse.segmentation.noise > 2 * NOISE
    found, known = fit(sparse, MACHINE, FREE), fit(Record(sparse.t, sparse.x, NOISE), MACHINE, FREE)
    assert found.converged and found.sigma_source == "scatter of the residuals"
    assert found.sigma == pytest.approx(NOISE, rel=0.15)
    for name in FREE:
        assert found.std_errors[name] == pytest.approx(known.std_errors[name], rel=0.15)


PATTERNS = [(share, blocks) for share in (0.01, 0.05, 0.2) for blocks in (False, True)]


@pytest.mark.parametrize("pattern", cases(PATTERNS, [(0.01, False)]))
def test_missing_rows_cost_their_information_only(record, pattern):
    (share, blocks), random, n = pattern, np.random.default_rng(1), len(record)
    lost = random.random(n) < share
    if blocks:
        length = round(share * n / 10)
        lost = np.isin(np.arange(n), random.integers(0, n - length, 10)[:, None] + np.arange(length))
    known = fit(Record(record.t[~lost], record.x[~lost], NOISE), MACHINE, FREE, noise="white")
    found = fit(Record(record.t, np.where(lost, np.nan, record.x)), MACHINE, FREE)
    assert found.converged and found.sigma == pytest.approx(NOISE, rel=0.1)
    for name in FREE:
        assert found.std_errors[name] == pytest.approx(known.std_errors[name], rel=0.05)


@pytest.mark.slow
def test_a_slow_decay_in_strong_noise():
    # Made with a frequency of 0.1127 Hz and a damping ratio of 0.058.
    run = read(Path(__file__).parents[1] / "data" / "cases" / "noisy_constant.csv")
    found = fit(run, Oscillator(1.0, 0.5, 0.08, 1.0, Coulomb(1e-3)), FREE, throw=False)
    frequency, ratio = found.kinematics["natural_frequency"], found.kinematics["damping_ratio"]
    assert abs(frequency.value - 0.1127) < 3 * frequency.std + 4e-4
    assert abs(ratio.value - 0.058) < 3 * ratio.std
