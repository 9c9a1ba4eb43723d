"""Choices of columns, units and scales; refusals; warnings about assumed units."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from fricjax.data import inspect, read
from fricjax.data.readers.header import scale_of
from fricjax.errors import DataError
from tests.cli.conftest import call
from tests.tables import check_rows

from .test_laboratory import MM, PAIRS, T, X, lines, row, rows


def written(path, title, pairs=PAIRS):
    path.write_text(lines(title, *(row(*pair, digits=9) for pair in pairs)))
    return path


SCALES = {
    "no unit": (None, None, 1.0),
    "unit of the title": ("mm", None, 1e-3),
    "unit given": (None, "um", 1e-6),
    "the same unit": ("um", "micron", 1e-6),
    "scale for volts": ("V", "12.5 um/V", 12.5e-6),
    "scale for volts spelt out": ("Volts", "-2 mm/V", -2e-3),
    "scale for counts": ("counts", "0.31 nm/count", 0.31e-9),
    "scale without a title": (None, "633e-9 m", 633e-9),
    "title that is no unit": ("furlongs", "mm", 1e-3),
}


def test_scale():
    def check(found, given, expected):
        scale, quantity = scale_of(found, given, ("m", "rad"), "the displacement 'x'", "unit")
        assert scale == pytest.approx(expected, rel=1e-14)
        assert quantity == "m"

    check_rows(check, SCALES)


CONTRADICTIONS = {
    "other unit": ("m", "micron", "'x' is in m by its title, but unit='micron' contradicts it: leave unit= out"),
    "other quantity": ("m", "deg", "is in m by its title, but unit='deg' contradicts it"),
    "volts": ("V", None, "is in V, which only a scale makes a displacement or a time; give it as unit='12.5 mm/V'"),
    "unit for volts": ("V", "mm", "is in V; give the scale as unit='12.5 mm/V'"),
    "scale for something else": ("mV", "12.5 um/V", "is in mV, but unit='12.5 um/V' is a scale for V"),
    "no unit": ("furlongs", None, "'furlongs' is not a known unit, but the displacement 'x' has it"),
    "scale of zero": (None, "0 mm", "cannot have the scale '0 mm', which is zero"),
    "time": (None, "2 ms", "The unit 'ms' does not fit the displacement 'x'"),
}


def test_contradictions():
    def check(found, given, sentence):
        with pytest.raises(DataError) as caught:
            scale_of(found, given, ("m", "rad"), "the displacement 'x'", "unit")
        assert sentence in str(caught.value)

    check_rows(check, CONTRADICTIONS)


def test_a_contradiction_ends_the_command(tmp_path):
    path = written(tmp_path / "run.csv", "Time [s],Displacement [m]", zip(T, X, strict=True))
    called = call("inspect", path, "--unit", "micron")
    assert called.code == 4
    assert "'Displacement' of run.csv is in m by its title, but --unit micron contradicts it" in called.err


ASKED = {
    "no time among titles": ("position,velocity", "has no time for 'position'; its columns are 'position', 'velocity'"),
    "two positions": ("Position 1,Position 2", "several columns that could be the displacement"),
    "only times": ("Time (s),Elapsed (s)", "holds no displacement, only 'Time', 'Elapsed'"),
    "samples and values": ("Index,x [mm]", "has no time for 'x'; its columns are 'Index', 'x'; give rate="),
}


def test_what_is_asked_back(tmp_path):
    def check(title, sentence):
        with pytest.raises(DataError) as caught:
            read(written(tmp_path / "run.csv", title))
        assert sentence in str(caught.value)

    check_rows(check, ASKED)


RATES = (
    "# sampling rate: 2.5 kHz", "sample_rate: 2500", "ActualRate = 2500", "Sample rate (kHz);2.5", "# fs=2.5e3",
    "Delta_X\t0.0004\nsampling interval: 0.0004",
)  # fmt: skip


def test_a_rate_in_the_file_gives_the_times(tmp_path):
    def check(preamble):
        path = tmp_path / "run.txt"
        path.write_text(lines(preamble, "x", *(f"{x:.6f}" for x in MM)))
        record = read(path)
        assert record.rate == pytest.approx(2500.0)
        assert "times from the rate of 2500 per second" in record.log[0].effect

    check_rows(check, {name: (name,) for name in RATES})
    np.savez(tmp_path / "run.npz", x=X, sample_rate=2500.0)
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["x"], file["ActualRate"] = X, 2500.0
    scipy.io.savemat(tmp_path / "run.mat", {"x": X, "Fs": 2500.0})
    for suffix in ("npz", "h5", "mat"):
        assert read(tmp_path / f"run.{suffix}").rate == pytest.approx(2500.0)


def test_seconds_are_preferred_to_times_of_day(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(lines("Clock,Time_Elapsed(s),x", *(f"12:00:{i // 10:02},{i / 10},{i % 7}" for i in range(40))))
    assert read(path).meta["columns"] == {"t": "Time_Elapsed", "x": "x"}


def test_the_log_names_other_displacements(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(lines("t,x,theta", *(f"{i},{i % 7},{i % 5}" for i in range(40))))
    assert read(path).log[0].effect.endswith("not 'theta'")


REFUSED = {
    "a bare angular velocity": ("rate_gyro.csv", "names no unit and seems to be a velocity", "unit='rad/s'"),
    "a filmed pendulum": ("tracker.txt", "lie on a circle of radius 0.418", "pendulum_length='0.42 m'"),
    "another header": ("header_other_separator.csv", "several columns", "('Forzante', 'Pendolo')"),
}


def test_what_no_fit_can_use_is_refused_with_the_reason():
    def check(name, *parts):
        with pytest.raises(DataError) as caught:
            read(Path(__file__).parent / "cases" / name)
        assert all(part in str(caught.value) for part in parts)

    check_rows(check, REFUSED)


# Titles of columns, with the SI unit of the reading and the value of 1 in it; None without a unit.
READINGS = {
    "acceleration (g)": ("m/s^2", 9.80665),
    "accelerometer [mg]": ("m/s^2", 9.80665e-3),
    "ax [m/s^2]": ("m/s^2", 1.0),
    "angular acceleration [rad/s^2]": ("rad/s^2", 1.0),
    "v [mm/s]": ("m/s", 1e-3),
    "gyro z (deg/s)": ("rad/s", np.pi / 180),
    "rate (rpm)": ("rad/s", np.pi / 30),
    "acc_x": (None, 0.0),
    "speed": (None, 0.0),
}


def test_accelerations_and_velocities_are_read_as_such(tmp_path):
    path = tmp_path / "run.csv"

    def check(title, unit, one):
        path.write_text(lines(f"t,{title}", *(f"{i},{i % 7}" for i in range(40))))
        if unit is None:
            with pytest.raises(DataError, match=r"names no unit and seems to be (a velocity|an acceleration)"):
                read(path)
        else:
            record = read(path)
            assert (record.quantity, record.x[1]) == (unit, pytest.approx(one, rel=1e-14))
        # A displacement is preferred to its derivatives.
        path.write_text(lines(f"t,{title},position", *(f"{i},{i % 7},{i}" for i in range(40))))
        assert read(path).meta["columns"]["x"] == "position"

    check_rows(check, {title: (title, *row) for title, row in READINGS.items()})
    path.write_text(lines("t,speed", *(f"{i},{i % 7}" for i in range(40))))
    assert read(path, unit="mm").x[1] == 1e-3
    path.write_text(lines("t,acc_x", *(f"{i},{i % 7}" for i in range(40))))
    assert read(path, unit="g").x[1] == 9.80665


@pytest.mark.parametrize("rows", [[0], [1, 5], range(1, 41), range(41)])
def test_delimiters_at_the_end_of_rows_mean_nothing(tmp_path, rows):
    table = ["t\tx", *(f"{i}\t{i % 7}" for i in range(40))]
    path = tmp_path / "run.txt"
    path.write_text(lines(*(row + "\t" if i in rows else row for i, row in enumerate(table))))
    assert read(path).x.tolist() == [i % 7 for i in range(40)] and read(path).meta["columns"] == {"t": "t", "x": "x"}


def test_a_record_is_cropped_on_reading(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(lines("t,x", *(f"{i},{i % 7}" for i in range(40))))
    assert read(path, crop=(10, 20)).t.tolist() == list(range(10, 21))
    assert read(path, crop=(None, 20)).trace.n == 21


UNUSABLE = {
    "complex": X + 1j * X,
    "empty": np.zeros(0),
    "words": np.array(["a"] * X.size),
    "records": np.zeros(X.size, "f8,i4"),
}


def test_the_time_never_stands_in_for_the_displacement(tmp_path):
    def check(values):
        np.savez(tmp_path / "run.npz", t=T, x=values)
        with pytest.raises(DataError, match=r"'x' in run\.npz (holds|is) .*, so it is no displacement"):
            read(tmp_path / "run.npz")

    check_rows(check, UNUSABLE)


def test_nor_in_matlab(tmp_path):
    def check(value):
        scipy.io.savemat(tmp_path / "run.mat", {"t": T, "x": value})
        with pytest.raises(DataError, match=r"'x' in run\.mat .*, so it is no displacement"):
            read(tmp_path / "run.mat")

    values = {
        "complex": X + 1j * X,
        "text": "text",
        "empty": np.zeros((0, 0)),
        "sparse": scipy.sparse.csc_array(np.diag(X)),
    }
    check_rows(check, values)


def test_a_unit_that_is_not_there_is_told_everywhere(tmp_path):
    path = written(tmp_path / "run.csv", "t,x", zip(T, X, strict=True))
    sentence = "run.csv names no unit for 'x': it is taken as m, 't' as s."
    record = read(path)
    assert record.doubts[0].startswith(sentence)
    assert inspect(record).warnings == record.doubts
    assert f"! {sentence} If that is not so, give --unit and --time-unit." in call("inspect", path).out
    assert json.loads(call("inspect", path, "--json").out)["warnings"][0].startswith(sentence)
    assert not read(path, unit="m").doubts and not read(path, unit="um").doubts


def test_scales_that_cannot_be_are_told(tmp_path):
    pairs = list(zip(T, X, strict=True))
    metres = read(written(tmp_path / "a.csv", "t [s],x [m]", [(t, 1e3 * x) for t, x in pairs]))
    assert "larger than that of any friction oscillator" in inspect(metres).warnings[0]
    fast = read(written(tmp_path / "b.csv", "t [ms],x [m]", [(t, 100 * x) for t, x in pairs]))
    assert "m/s and" in inspect(fast).warnings[0] and "times gravity" in inspect(fast).warnings[0]
    turns = read(written(tmp_path / "c.csv", "t [s],angle [rad]", [(t, 1e4 * x) for t, x in pairs]))
    assert "more than a full turn: were degrees taken for radians?" in inspect(turns).warnings[0]
    noise = 1e-3 * np.random.default_rng(0).standard_normal(T.size)
    small = read(
        written(tmp_path / "d.csv", "t [s],x [pm]", [(t, 1e3 * x + e) for (t, x), e in zip(pairs, noise, strict=True)])
    )
    assert "less than that of a milliwatt of light" in inspect(small).warnings[0]
    assert inspect(read(written(tmp_path / "e.csv", "t [s],x [mm]"))).warnings == ()


def test_a_bad_row_among_long_ones(tmp_path):
    path = tmp_path / "run.csv"
    body = rows()
    path.write_text(lines("t [s],x [mm]", *body[:300], "1.5,2.0,3.0", *body[300:]))
    with pytest.raises(DataError, match=r"run.csv, row 302: 3 fields, but 2 were expected"):
        read(path)
    path.write_text(lines("t [s],x [mm],note", *(f"{each},ok" for each in body[:300]), "1.5,oops,ok", *body[300:]))
    with pytest.raises(DataError, match=r"run.csv, row 302, column 'x': 'oops' is not a number"):
        read(path)


def test_numbers_count_the_columns_of_the_file(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(lines(*(f",{1e3 * b:.6f},,{a:.6f}," for a, b in PAIRS)))
    assert read(path, column=1, time=3, unit="um").x == pytest.approx(X, abs=1e-12)
    path.write_text(lines("t,x,x", *(row(a, b, b) for a, b in PAIRS)))
    with pytest.raises(DataError, match=r"has 2 columns 'x'; choose one by its number, column=1 or column=2\."):
        read(path, column="x")
