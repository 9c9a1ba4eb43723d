"""Each preparation step returns a new record and logs its effect."""

import json

import numpy as np
import pytest

from fricjax.data import (
    Record,
    Trace,
    convert_unit,
    crop,
    estimate_noise,
    find_first_reversal,
    find_release,
    find_rest,
    flip_sign,
    inspect,
)
from fricjax.errors import DataError, UsageError
from tests.oracles import coulomb_viscous

NOISE = 2e-9
EXACT = coulomb_viscous(np.arange(0, 1, 1e-4), 2e-3, frequency=12.6, zeta=0.003, dead_band=8e-5, release=0.1)


@pytest.fixture
def record():
    x = EXACT.x + NOISE * np.random.default_rng(0).standard_normal(EXACT.x.size)
    return Record(Trace(EXACT.t, x), {"source": "run.csv", "quantity": "m"})


def test_crop(record):
    cropped = crop(record, 0.2, 0.5)
    assert (cropped.trace.t[0], cropped.trace.t[-1]) == (pytest.approx(0.2), pytest.approx(0.5))
    assert cropped.log[-1].name == "crop"
    assert "kept 3001 of 10000 samples" in cropped.log[-1].effect
    assert record.trace.n == 10000 and record.log == ()
    assert crop(record, stop=0.1).trace.t[0] == 0.0


def test_crop_keeps_sigma_and_mask():
    trace = Trace(np.arange(5.0), np.arange(5.0), np.arange(1.0, 6.0), [True, True, False, True, True])
    cropped = crop(Record(trace), 1.0, 3.0).trace
    assert np.asarray(cropped.sigma).tolist() == [2.0, 3.0, 4.0]
    assert cropped.mask.tolist() == [True, False, True]


def test_crop_to_nothing(record):
    with pytest.raises(DataError, match="Only 0 samples lie between 5 s and inf s"):
        crop(record, 5.0)
    with pytest.raises(UsageError, match="stop must come after start"):
        crop(record, 0.5, 0.2)


def test_convert_unit():
    record = Record(Trace([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], 0.1), {"quantity": "m", "release_time": 1.0})
    turned = convert_unit(record, "deg", "ms")
    assert turned.trace.x == pytest.approx(np.deg2rad([1, 2, 3]))
    assert turned.trace.t == pytest.approx([0, 1e-3, 2e-3])
    assert turned.trace.sigma == pytest.approx(np.deg2rad(0.1))
    assert (turned.quantity, turned.release) == ("rad", pytest.approx(1e-3))
    with pytest.raises(DataError, match="'kg' does not fit the displacement"):
        convert_unit(record, "kg")


def test_flip_sign(record):
    flipped = flip_sign(record)
    assert np.array_equal(flipped.trace.x, -record.trace.x)
    assert np.array_equal(flip_sign(flipped).trace.x, record.trace.x)


def test_landmarks(record):
    found = find_rest(find_first_reversal(find_release(record)))
    assert found.release == found.meta["release_time"] == pytest.approx(0.1, abs=1e-4)
    assert found.meta["first_reversal_time"] == pytest.approx(EXACT.stops[0], abs=1e-4)
    assert found.meta["rest_time"] == pytest.approx(EXACT.stops[-1], abs=4e-4)
    assert found.meta["rest_position"] == pytest.approx(EXACT.points[-1], abs=NOISE)
    assert [step.name for step in found.log] == ["find_release", "find_first_reversal", "find_rest"]
    assert f"after {EXACT.n_half_cycles} half-cycles" in found.log[-1].effect
    flipped = flip_sign(found)
    assert flipped.meta["rest_position"] == -found.meta["rest_position"]


def test_a_record_in_motion_has_no_rest(record):
    moving = find_rest(crop(record, 0.1, 0.3))
    assert moving.meta["rest_time"] is None
    assert "still moves" in moving.log[-1].effect


def test_one_stroke_has_no_reversal():
    t = np.arange(0, 0.2, 1e-4)
    stroke = coulomb_viscous(t, 2e-3, frequency=12.6, zeta=0.003, dead_band=1e-3)
    assert stroke.n_half_cycles == 1
    with pytest.raises(DataError, match="has no reversal"):
        find_first_reversal(Record(Trace(t, stroke.x)))


def test_noise_becomes_sigma(record):
    noisy = estimate_noise(record)
    assert noisy.trace.sigma is not None
    assert noisy.trace.sigma == pytest.approx(NOISE, rel=0.1)
    assert noisy.meta["noise"] == float(noisy.trace.sigma)
    computed = coulomb_viscous(np.arange(0, 1, 1e-4), 2e-3, frequency=12.6, zeta=0.0, dead_band=3e-4)
    with pytest.raises(DataError, match="has no noise"):
        estimate_noise(Record(Trace(computed.t, computed.x)))


def test_a_record_shows_itself(record):
    found = find_release(record)
    assert repr(found) == "Record('run.csv', 10000 samples, 0..0.9999 s, x in m, 1 steps)"
    assert "find_release(): the free motion starts at" in found.summary()
    assert "<table>" in found._repr_html_() and "run.csv" in found._repr_html_()


def test_inspection(record):
    found = inspect(record)
    assert found.rate == pytest.approx(1e4)
    assert found.regular and found.gaps == 0 and found.masked == 0
    assert found.noise == pytest.approx(NOISE, rel=0.1)
    assert found.n_half_cycles == EXACT.n_half_cycles == 2 * found.cycles
    assert found.frequency == pytest.approx(12.6, rel=1e-3)
    assert json.loads(json.dumps(found.to_dict()))["samples"] == 10000
    for text in (found.summary(), found._repr_html_()):
        assert "10000 Hz, regular" in text and "12.6" in text
        assert f"{1e9 * found.noise:.3g} nm rms" in text and f"{1e3 * found.amplitude:.6g} mm" in text


def test_inspection_counts_gaps_in_samples_and_in_time(record):
    trace = record.trace
    keep = np.ones(trace.n, dtype=bool)
    keep[4000:4050] = False
    x = np.where((trace.t > 0.3) & (trace.t < 0.302), np.nan, trace.x)
    found = inspect(Record(Trace(trace.t[keep], x[keep])))
    assert (found.gaps, found.masked, found.regular) == (2, 19, False)
    assert found.longest_gap == pytest.approx(51e-4)
    assert "2, the longest 0.0051 s" in found.summary()


def test_a_constant_record_is_not_inspected():
    with pytest.raises(DataError, match="x is constant"):
        inspect(Record(Trace(np.arange(50.0), np.ones(50))))
