"""Tables and arrays in memory give the same record as files."""

import datetime
import warnings
from decimal import Decimal
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

import fricjax as fj
from fricjax.data.gather import gather
from fricjax.errors import DataError, UsageError
from tests.tables import check_rows

N = 400
T = np.arange(N) / 500.0
X = 2e-3 * np.exp(-T) * np.cos(40.0 * T)
MS, UM = 1e3 * T, 1e6 * X
NUMBERS = pd.DataFrame({"Time [ms]": MS, "Displacement [um]": UM})


class Labelled:
    """The attributes of an xarray.DataArray that the readers use.

    xarray is not a dependency of the package.
    """

    dims = ("time",)

    def __init__(self, values, units, name=None, coords=None):
        self.values, self.name, self.attrs, self.coords = values, name, {"units": units}, coords or {}

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype)


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("memory") / "run.csv"
    NUMBERS.to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def from_file(file) -> fj.Record:
    return fj.read(file)


def quantity(values, unit):
    import pint

    return pint.UnitRegistry().Quantity(values, unit)


def read_only(values):
    values = values.copy()
    values.flags.writeable = False
    return values


STEPS = np.round(2.0 * np.arange(N)).astype(int)
TABLES = {
    "table": NUMBERS,
    "columns in another order": NUMBERS[["Displacement [um]", "Time [ms]"]],
    "table with other columns": NUMBERS.assign(note="a", valid=True, empty=np.nan),
    "index of times": NUMBERS.set_index("Time [ms]"),
    "series with times": NUMBERS.set_index("Time [ms]")["Displacement [um]"],
    "series of both": (NUMBERS["Time [ms]"], NUMBERS["Displacement [um]"]),
    "objects": NUMBERS.astype(object),
    "nullable": NUMBERS.convert_dtypes(),
    "dict": {"Time [ms]": MS, "Displacement [um]": list(UM), "name": "run 7", "ragged": [[1.0], [2.0, 3.0]]},
    "structured": np.rec.fromarrays([MS, UM], names=["Time [ms]", "Displacement [um]"]),
    "xarray": Labelled(UM, "um", "Displacement", {"time": Labelled(MS, "ms", "time")}),
    "pint": (quantity(MS, "ms"), quantity(UM, "um")),
}


def test_a_table_gives_the_record_of_its_file(from_file):
    def check(name):
        record = fj.read(TABLES[name])
        assert np.array_equal(record.t, from_file.t) and np.array_equal(record.x, from_file.x)
        assert np.array_equal(record.mask, from_file.mask)
        assert record.quantity == "m" and record.name == ""

    check_rows(check, list(TABLES))


ARRAYS = {
    "pair": (T, X),
    "lists": (T.tolist(), X.tolist()),
    "columns of matrices": (T[:, None], X[None, :]),
    "read-only": (read_only(T), read_only(X)),
    "jax": (jnp.asarray(T), jnp.asarray(X)),
    "trace": fj.Trace(T, X),
    "record": fj.Record(T, X),
    "float index": pd.Series(X, T),
    "integers": ((T * 500).astype(int), X),
}


def test_arrays_are_in_seconds_and_metres():
    def check(name):
        with warnings.catch_warnings(record=True) as caught:
            record = fj.read(ARRAYS[name])
        assert np.array_equal(record.t, T * (500 if name == "integers" else 1)) and np.array_equal(record.x, X)
        assert not caught

    check_rows(check, list(ARRAYS))


CLOCKS = {
    "durations": pd.to_timedelta(STEPS, unit="ms"),
    "dates": pd.Timestamp("2024-05-01") + pd.to_timedelta(STEPS, unit="ms"),
    "dates with a zone": pd.Timestamp("2024-05-01", tz="Europe/Berlin") + pd.to_timedelta(STEPS, unit="ms"),
}


def test_dates_and_durations_are_times():
    def check(index):
        for source in (
            pd.Series(X, index),
            pd.DataFrame({"x": X}, index),
            pd.DataFrame({"when": index, "x": X}),
            (index, X),
            {"clock": np.array(index), "x": X},
        ):
            record = fj.read(source)
            assert np.array_equal(record.t, STEPS / 1000.0) and np.array_equal(record.x, X)

    check_rows(check, CLOCKS)


def test_dates_of_the_standard_library():
    start = datetime.datetime(2024, 5, 1)
    dates = np.array([start + datetime.timedelta(milliseconds=int(step)) for step in STEPS], object)
    assert np.allclose(fj.read((dates, X)).t, STEPS / 1000.0, rtol=0, atol=1e-12)


def test_displacements_with_a_rate_or_times(file):
    for source in (X, X.tolist(), jnp.asarray(X), pd.Series(X), X[:, None]):
        record = fj.read(source, rate=500.0)
        assert np.array_equal(record.t, T) and np.array_equal(record.x, X)
    assert np.array_equal(fj.read(UM, t=MS, unit="um", time_unit="ms").x, fj.read(file).x)
    assert np.array_equal(fj.read(NUMBERS, column=1, rate=500.0).x, fj.read(file, column=1, rate=500.0).x)
    counted = pd.DataFrame({"a [um]": UM}, pd.Index(range(N), name="sample"))
    assert np.array_equal(fj.read(counted, rate=500.0).x, fj.read(file).x)
    assert np.array_equal(fj.read(counted, time="sample", time_unit="ms").t, np.arange(N) * 1e-3)
    turned = fj.read((T, np.rad2deg(X)), unit="deg", sign=-1, sigma=0.1)
    assert turned.quantity == "rad" and np.allclose(turned.x, -X) and turned.sigma == pytest.approx(np.deg2rad(0.1))


def test_options_choose_columns_as_in_files(tmp_path):
    table = pd.DataFrame({"t [s]": T, "a [mm]": 1e3 * X, "b [um]": UM})
    path = tmp_path / "two.csv"
    table.to_csv(path, index=False)
    for column in ("b", 2):
        assert np.array_equal(fj.read(table, column=column).x, fj.read(path, column=column).x)
    assert np.array_equal(fj.read(table, column="b [um]").x, fj.read(path, column="b").x)
    assert fj.read(table, column="a", sigma=1e-3).sigma == pytest.approx(1e-6)


def test_samples_left_out_are_masked():
    holes = X.copy()
    holes[[3, 7]] = np.nan
    cells = [None if np.isnan(x) else Decimal(x) for x in holes]
    missing = pd.DataFrame({"t": T, "x": pd.array([pd.NA if np.isnan(x) else x for x in holes], dtype="Float64")})
    for source in ((T, holes), {"t": T, "x": cells}, missing, (T, np.ma.array(X, mask=np.isnan(holes)))):
        record = fj.read(source)
        assert np.flatnonzero(~record.mask).tolist() == [3, 7]
        assert np.array_equal(record.x[record.mask], X[record.mask])


SQUARE = np.stack([T, X])
REFUSED = {
    "nothing": (None, {}, UsageError, r"A record cannot be made of NoneType\. Give a path, a record, a pandas table"),
    "no times": (
        X,
        {},
        UsageError,
        r"needs either their rate or their times: a tuple \(t, x\), fricjax\.read\(x, rate=5000\.0\) or "
        r"fricjax\.fit\(x, \.\.\., rate=5000\.0\)\.$",
    ),
    "both": (X, {"rate": 1.0, "t": T}, UsageError, "needs either their rate or their times"),
    "series without times": (pd.Series(X), {}, DataError, "Series has no time for 'x'; give rate="),
    "two rows": (SQUARE, {}, UsageError, r"shape \(2, 400\) a run or two\? Write \(a\[0\], a\[1\]\) for times and dis"),
    "two columns": (SQUARE.T, {"rate": 1.0}, UsageError, r"run or two\? Write \(a\[:, 0\], a\[:, 1\]\) for times"),
    "three columns": (np.ones((N, 3)), {}, UsageError, r"'x' must be one-dimensional, but it has shape \(400, 3\)"),
    "several": (
        [(T, X)] * 2,
        {},
        UsageError,
        r"read takes one run, got a list of 2\. Write a tuple \(t, x\) for times",
    ),
    "complex": ((T, X + 0j), {}, DataError, "array holds complex numbers in 'x', but a displacement is real"),
    "complex column": (NUMBERS + 0j, {}, DataError, r"'Displacement.*' in DataFrame holds complex numbers"),
    "levels": (
        pd.concat({"a": NUMBERS}, axis=1),
        {},
        DataError,
        r"several levels, as \('a', .* take one, table\['a'\]",
    ),
    "twice": (
        pd.concat([NUMBERS, NUMBERS], axis=1),
        {},
        DataError,
        r"has the column 'Time \[ms\]' more than once; ren",
    ),
    "words": (pd.DataFrame({"t": T, "x": ["1,5", *UM[1:]]}), {"column": "x"}, DataError, r"column 'x', row 0 \(the fi"),
    "only words": (
        pd.DataFrame({"t": T, "x": "a"}),
        {},
        DataError,
        "'x' in DataFrame holds words, so it is no displacement",
    ),
    "open": (
        pd.DataFrame({"t": T, "a": X, "b": X}),
        {},
        DataError,
        r"several columns .*\('a', 'b'\); name one with col",
    ),
    "no such column": (
        NUMBERS,
        {"column": "Displacment"},
        DataError,
        "no column 'Displacment'.* Did you mean 'Displac",
    ),
    "not a length": (
        pd.DataFrame({"t": T, "x [kg]": X}),
        {},
        DataError,
        "The unit 'kg' does not fit the displacement 'x' ",
    ),
    "a date as x": ((T, CLOCKS["dates"]), {}, DataError, "The unit 's' does not fit the displacement"),
    "time back": ((T[::-1], X), {}, DataError, r"column 't', row 1 \(the first is 0\): the time is not increasing"),
    "lengths": ((T[1:], X), {}, DataError, r"^There are 399 times and 400 displacements; give as many of each\.$"),
    "wrong option": (NUMBERS, {"colum": 1}, UsageError, "colum= is no option for tables. Did you mean 'column='"),
    "option of files": ((T, X), {"decimal": ","}, UsageError, "decimal= is no option for times and displacements"),
    "unit of a record": (fj.Record(T, X), {"unit": "mm"}, UsageError, "unit= is no option for records"),
}


def test_refused_in_words():
    def check(source, options, kind, sentence):
        with pytest.raises(kind, match=sentence) as caught:
            fj.read(source, **options)
        assert "\n" not in str(caught.value)

    check_rows(check, REFUSED)


def test_one_run_or_several(file, from_file):
    assert [len(gather(source)) for source in (file, str(file), (T, X), [(T, X)], NUMBERS, from_file)] == [1] * 6
    several = gather([file, NUMBERS, (T, X), fj.Trace(T, X), from_file])
    assert len(several) == 5 and several[4] is from_file
    assert [record.name for record in several] == ["run.csv", "", "", "", "run.csv"]
    assert [record.name for record in gather(file.parent.glob("*.csv"))] == ["run.csv"]
    with pytest.raises(UsageError, match="There is no run: the list is empty"):
        gather([])


def test_what_needs_options_is_read_first(tmp_path):
    path = tmp_path / "two.csv"
    pd.DataFrame({"t": T, "a": X, "b": X}).to_csv(path, index=False)
    with pytest.raises(
        DataError, match=r"name one with column=\. Read it first: fricjax\.read\('.*two\.csv', \.\.\.\)\."
    ):
        gather(path)
    with pytest.raises(UsageError, match=r"^run 1: An array is read as displacements.*, rate=5000\.0\)\.$"):
        gather([(T, X), X])
    with pytest.raises(
        DataError, match=r"run 1: Series has no time for 'x'.* Read it first: fricjax\.read\(table, \.\.\.\)\."
    ):
        gather([(T, X), pd.Series(X)])
    with pytest.raises(DataError, match=r"There is no file .*none\.csv\..* Check the path\.$"):
        gather(tmp_path / "none.csv")


def test_a_record_shows_its_samples():
    record = fj.Record(T, X, sigma=1e-9)
    assert np.array_equal(record.t, T) and np.array_equal(record.x, X) and record.sigma == 1e-9
    assert record.mask.all() and len(record) == N and record.rate == pytest.approx(500.0)
    assert record.duration == pytest.approx(T[-1]) and record.name == ""
    assert np.array_equal(fj.Record(x=X, rate=500.0).t, T)
    whole = fj.Record(record.trace, {"source": "a.csv"}, [])
    assert whole.name == "a.csv" and whole.trace is record.trace and whole.log == ()
    assert fj.Record(trace=record.trace).meta == {}
    for wrong in (("run.csv",), (X,), ()):
        with pytest.raises(UsageError, match=r"Trace\(t, x\) or Trace\(x=x, rate=5000\.0\)\. A file, a data frame or "):
            fj.Record(*wrong)
    with pytest.raises(UsageError, match="rate must be a positive number of samples per second, but it is 0"):
        fj.Trace(x=X, rate=0)
    with pytest.raises(UsageError, match="either their times or their rate"):
        fj.Trace(T, X, rate=1.0)


def test_dates_and_complex_numbers_are_no_samples_of_a_trace():
    for array in (X + 0j, jnp.asarray(X) + 0j, T.astype("m8[s]")):
        with pytest.raises(DataError, match="must hold real numbers, but its type is"):
            fj.Trace(T, array)


def test_a_table_of_a_record_is_read_back(from_file):
    holes = fj.read((T, np.where(T[5] == T, np.nan, X)), unit="rad")
    for record in (from_file, holes):
        table = record.to_dataframe()
        assert list(table) == ["t", "x", "used"] and table.attrs["units"] == {"t": "s", "x": record.quantity}
        back = fj.read(table)
        assert np.array_equal(back.x, record.x) and np.array_equal(back.mask, record.mask)
        assert (back.quantity, back.name) == (record.quantity, record.name)
    assert holes.to_dataframe()["x"].isna().sum() == 1


@pytest.mark.parametrize(("size", "unit"), [(1.0, "mm"), (1e-3, "um"), (1e-6, "nm")])
def test_the_picture_has_units_and_marks(size, unit):
    held = np.concatenate([np.full(100, X[0]), X])
    noise = 1e-9 * np.random.default_rng(0).standard_normal(held.size)
    drawing = fj.Record(x=size * (held + noise), rate=500.0).plot()
    axes = drawing.axes[0]
    assert axes.get_xlabel() == "Time [s]" and axes.get_ylabel() == f"Displacement [{unit}]"
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert (
        words[0] == "record" and "reversals" in words[1] and words[2] == "hold" and words[3].startswith("release 0.1")
    )
    drawn = axes.lines[0].get_ydata()
    assert np.max(np.abs(drawn)) == pytest.approx(2.0, rel=1e-3)


def test_a_record_without_a_motion_is_drawn_all_the_same():
    still = fj.Record(fj.Trace(T, np.full(N, 1e-3)), {"source": "still.csv", "quantity": "rad"}).plot()
    assert still.axes[0].get_title().startswith("still.csv: x is constant")
    assert still.axes[0].get_ylabel() == "Angle [mrad]"
