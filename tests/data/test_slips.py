"""Slips and dropouts are found in every noise, without false alarms."""

import numpy as np
import pytest

from experiments.archive.slips import NOISES, make
from fricjax.data import Record, find_dropouts, find_slips, inspect, mask_dropouts, read, repair_slips
from fricjax.data.slips import slips
from fricjax.errors import DataError, UsageError
from tests.oracles import coulomb_viscous
from tests.tables import check_rows

T = np.arange(0, 1, 1 / 5000)
FRINGE = 158.2e-9
TRUTH = coulomb_viscous(T, 2e-3, frequency=12.6, zeta=0.003, dead_band=8e-5, release=0.1)
X = TRUTH.x + 2e-9 * np.random.default_rng(3).standard_normal(T.size)


def slipped(*places, fringes=1):
    return Record(T, X + FRINGE * fringes * np.sum(np.arange(T.size) >= np.array(places)[:, None], axis=0))


@pytest.mark.parametrize("noise", NOISES)
def test_slips_are_found_where_they_are_and_nowhere_else(noise):
    for seed in range(12):
        run = make(seed, noise)
        assert slips(run.clean) == []
        found = {slip.index for slip in slips(run.slipped)}
        assert found <= set(run.places.tolist())
        # Slow noise can hide a step of six standard deviations of its second difference.
        if noise in ("white", "rounded"):
            assert found >= set(run.places[run.smooth].tolist())


def test_a_release_and_stops_without_noise_are_no_slips():
    for rate in (1e3, 5e3, 5e4):
        t = np.arange(0, 1, 1 / rate)
        assert slips(coulomb_viscous(t, 2e-3, frequency=12.6, zeta=0.003, dead_band=8e-5, release=0.1).x) == []


@pytest.mark.parametrize("fringes", [1, -1, 3])
def test_a_record_is_repaired_to_what_it_was(fringes):
    record = slipped(1200, 2600, fringes=fringes)
    repaired = repair_slips(record, FRINGE)
    assert repaired.x == pytest.approx(X, abs=1e-18)
    assert "2 slips taken out: " in repaired.log[-1].effect and " nm at 0.24 s, " in repaired.log[-1].effect
    [first, second] = find_slips(record)
    by_sight = repair_slips(record)
    assert np.abs(by_sight.x - X).max() < 5 * np.hypot(first.std, second.std)
    assert repair_slips(repaired, FRINGE).trace is repaired.trace


def test_only_whole_fringes_count_where_the_fringe_is_known():
    assert len(find_slips(slipped(1200), 2 * FRINGE)) == 0
    assert find_slips(slipped(1200, fringes=2), 2 * FRINGE)[0].size == 2 * FRINGE
    with pytest.raises(UsageError, match="fringe must be a positive length"):
        find_slips(slipped(1200), -1.0)


def test_gaps_and_uneven_samples_cut_a_record_into_stretches():
    record = slipped(1200)
    mask = np.ones(T.size, dtype=bool)
    mask[2000:2010] = False
    assert [slip.index for slip in find_slips(Record(T, record.x, mask=mask))] == [1200]
    assert find_slips(Record(np.delete(T, slice(1195, 1205)), np.delete(record.x, slice(1195, 1205)))) == []


def test_a_lost_signal_and_the_end_of_a_converter_are_dropouts():
    held = X.copy()
    held[900:930] = held[900]
    assert [each[:2] for each in find_dropouts(Record(T, held))] == [(900, 930)]
    clipped = np.minimum(X, 0.9 * X.max())
    found = find_dropouts(Record(T, clipped))
    assert found and all(each.value == clipped.max() for each in found)
    assert sum(each.stop - each.start for each in found) >= np.count_nonzero(clipped[520:] == clipped.max())
    masked = mask_dropouts(Record(T, held))
    assert np.flatnonzero(~masked.mask).tolist() == list(range(900, 930))
    assert "30 samples in 1 dropout masked: 0.18 s to 0.1858 s" in masked.log[-1].effect
    assert find_slips(masked) == [] and find_dropouts(masked) == []


def test_values_that_repeat_at_rest_or_between_counts_are_no_dropouts():
    for step in (1e-9, 1e-7, 1e-5):
        assert find_dropouts(Record(T, np.round(X / step) * step)) == []
    assert find_dropouts(Record(T, TRUTH.x)) == []


def test_what_a_record_shows_is_told_with_the_words_that_repair_it(tmp_path):
    record = slipped(1200)
    [sentence] = inspect(record).warnings
    assert "steps between two samples as no decay can, by 15" in sentence and "repair='slips=158.2 nm'" in sentence
    held = X.copy()
    held[900:930] = held[900]
    assert "repeats one value where the mass was elsewhere, at 0.18 s" in inspect(Record(T, held)).warnings[0]
    # Encoders have no fringes.
    assert inspect(Record(record.trace, {"quantity": "rad"})).warnings == ()
    np.savetxt(tmp_path / "run.csv", np.stack([T, record.x], axis=1), delimiter=",", header="t [s],x [m]", fmt="%.12g")
    mended = read(tmp_path / "run.csv", repair="dropouts, slips=158.2 nm")
    assert mended.x == pytest.approx(X, abs=1e-14)
    assert [step.name for step in mended.log] == ["read", "mask_dropouts", "repair_slips"]
    assert read((T, record.x), repair="slips").x == pytest.approx(X, abs=1e-8)


NO_REPAIRS = [
    ("slip", UsageError, "There is no fault 'slip' to repair. Did you mean 'slips'"),
    ("", UsageError, "repair= names no fault"),
    ("dropouts=3", UsageError, "There is no fault 'dropouts=3' to repair"),
    ("slips=3", DataError, "'3' has no unit for the fringe; write for example '3 mm'"),
    ("slips=3 kg", DataError, "The unit 'kg' does not fit the fringe"),
    ("slips=3 deg", DataError, "The unit 'deg' does not fit the fringe of"),
]


def test_words_that_name_no_repair():
    def check(words, error, message):
        with pytest.raises(error, match=message):
            read((T, X), repair=words)

    check_rows(check, NO_REPAIRS)
