"""Clock faults are found, named and repaired, and they are no slips."""

from pathlib import Path

import numpy as np
import pytest

from fricjax.data import Record, find_clock_faults, find_dropouts, find_slips, inspect, read, repair_clock
from fricjax.errors import DataError
from tests.oracles import coulomb_viscous

CASES = Path(__file__).parent / "cases"
RATE = 5000
T = np.arange(0, 1, 1 / RATE)
TRUTH = coulomb_viscous(T, 2e-3, frequency=12.6, zeta=0.003, dead_band=8e-5, release=0.1)
X = TRUTH.x + 2e-9 * np.random.default_rng(3).standard_normal(T.size)
PLACES = [640, 1210, 1777]


@pytest.mark.parametrize("ticks", [-1, 1, 2])
def test_lost_and_doubled_ticks_are_repaired(ticks):
    if ticks > 0:
        samples = np.delete(np.arange(T.size), [place + i for place in PLACES for i in range(ticks)])
    else:
        samples = np.insert(np.arange(T.size), PLACES, np.array(PLACES) - 1)
    record = Record(x=X[samples], rate=RATE)
    assert [round(fault.shift * RATE) for fault in find_clock_faults(record)] == 3 * [ticks]
    assert find_slips(record) == []
    repaired = repair_clock(record)
    assert repaired.t == pytest.approx(T[np.unique(samples)], abs=1e-12)
    assert find_clock_faults(repaired) == []
    assert "repair='clock'" in inspect(record).warnings[0]


@pytest.mark.parametrize("jump", [0.0123, 1e5])
def test_a_jump_of_the_clock_is_taken_out(jump):
    record = Record(T + jump * (np.arange(T.size) >= 1210), X)
    assert repair_clock(record).t == pytest.approx(T, abs=1e-9)


@pytest.mark.parametrize("kept", [2, 3, 4, "random"])
def test_repeated_samples_of_a_slow_sensor_are_removed(kept):
    new = np.arange(T.size) % kept == 0 if kept != "random" else np.random.default_rng(0).random(T.size) < 0.7
    new[0] = True
    record = Record(T, X[np.maximum.accumulate(np.where(new, np.arange(T.size), 0))])
    assert find_slips(record) == [] == find_dropouts(record)
    repaired = repair_clock(record)
    assert repaired.t.tolist() == T[new].tolist()
    assert repaired.segmentation.noise == pytest.approx(2e-9, rel=0.15)


@pytest.mark.parametrize("rounded", [0.0, 1e-7, 1e-5])
def test_a_right_clock_has_no_faults(rounded):
    random = np.random.default_rng(1)
    x = np.round(X / rounded) * rounded if rounded else X
    incomplete = (random.random(T.size) > 0.1) & ~((T > 0.3) & (T < 0.33))
    for record in (Record(T, x), Record(T[incomplete], x[incomplete])):
        assert find_clock_faults(record) == [] == find_dropouts(record)


def test_a_slip_of_the_counter_is_no_fault_of_the_clock():
    slipped = Record(T, X + 158.2e-9 * (np.arange(T.size) >= 1210))
    assert find_clock_faults(slipped) == [] and [slip.index for slip in find_slips(slipped)] == [1210]


def test_a_logger_that_writes_samples_twice():
    found = inspect(CASES / "logger_repeats.csv")
    assert len(found.warnings) == 1 and "the clock is wrong by -1 ms at 0.701 s" in found.warnings[0]
    repaired = read(CASES / "logger_repeats.csv", repair="clock,slips")
    assert repaired.log[1].effect.endswith("5 repeated samples removed")
    assert repaired.log[2].effect == "0 slips taken out"
    # The noise is 3.5 um.
    assert inspect(repaired).warnings == () and repaired.segmentation.noise == pytest.approx(3.5e-6, rel=0.03)


@pytest.mark.parametrize(
    ("name", "refusal"),
    [
        ("gap_1e5s.csv", "gap_1e5s.csv: The clock jumps by 100000 s after 1 s (sample 1001 of 2000)"),
        ("clock_set_in_run.csv", "The clock jumps by 1.7e+09 s after 1 s (sample 1001 of 2000)"),
        ("last_row_bad.csv", "The clock jumps by 1e+07 s after 1.998 s (sample 1999 of 2000)"),
        ("turning_points_only.csv", "the record holds its turning points only, or two samples per cycle"),
    ],
)
def test_records_that_no_fit_can_use_are_refused(name, refusal):
    with pytest.raises(DataError) as error:
        inspect(CASES / name)
    assert refusal in str(error.value)


@pytest.mark.parametrize("name", ["gap_1e5s.csv", "clock_set_in_run.csv"])
def test_the_remedy_for_a_jump_of_the_clock_works(name):
    found = inspect(read(CASES / name, repair="clock"))
    assert found.duration == pytest.approx(2.0, abs=2e-3) and found.n_half_cycles > 5 and found.warnings == ()


def test_a_slow_decay_in_strong_noise_is_no_constant():
    found = read(CASES / "noisy_constant.csv").segmentation
    assert found.frequency == pytest.approx(0.1127, rel=0.15)
    with pytest.raises(DataError, match="x is constant"):
        inspect(Record(x=np.random.default_rng(0).standard_normal(5000), rate=100.0))


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("blocks", [False, True])
def test_missing_rows_change_neither_noise_nor_reversals(share, blocks):
    random, full = np.random.default_rng(0), Record(T, X).segmentation
    lost = random.random(T.size) < share
    if blocks:
        length = round(share * T.size / 10)
        lost = np.isin(np.arange(T.size), random.integers(0, T.size - length, 10)[:, None] + np.arange(length))
    for record in (Record(T[~lost], X[~lost]), Record(T, np.where(lost, np.nan, X)), Record(T, X, None, ~lost)):
        found = record.segmentation
        assert found.noise == pytest.approx(2e-9, rel=0.1)
        assert found.n_half_cycles == full.n_half_cycles
        assert found.turning_times == pytest.approx(full.turning_times, abs=2e-5)
