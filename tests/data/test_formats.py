"""Each binary format returns its runs and units, or a clear refusal."""

import itertools
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest
import pyuff
import scipy.io
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

from fricjax.data import Record, read
from fricjax.errors import DataError, UsageError
from tests.tables import check_rows

N = 40
T = np.arange(N) / 2000
X = 1e-3 * np.cos(80 * T)


def same(record, rel=1e-13):
    assert record.t == pytest.approx(T, rel=1e-13, abs=1e-15)
    assert record.x == pytest.approx(X, rel=rel)
    return record.mask.all() and record.quantity == "m" and not record.doubts


def write_tdms(path, groups):
    """Write groups of channels, each with name, numbers and properties."""
    with TdmsWriter(path) as writer:
        for group, channels in groups.items():
            writer.write_segment([ChannelObject(group, *channel) for channel in channels])


def write_uff(path, binary, sets=1, **changes):
    path.unlink(missing_ok=True)
    given = {
        "binary": binary, "func_type": 1, "rsp_node": 3, "rsp_dir": 3, "ref_node": 1, "ref_dir": 1, "data": 1e6 * X,
        "x": T, "abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": 1 / 2000, "abscissa_spec_data_type": 17,
        "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "um", "abscissa_axis_units_lab": "s",
        "orddenom_spec_data_type": 0,
    }  # fmt: skip
    with warnings.catch_warnings():
        # pyuff leaves its files open until garbage collection.
        warnings.simplefilter("ignore", ResourceWarning)
        for _ in range(sets):
            pyuff.UFF(str(path)).write_sets(pyuff.prepare_58(**given | changes), "add")


def write_mdf(path, groups, compression: Any = 0):
    with MDF(version="4.10") as file:
        for signals in groups:
            file.append([Signal(samples, T, name=name, unit=unit) for name, samples, unit in signals])
        file.save(path, overwrite=True, compression=compression)


def write_netcdf(path, version, **attributes):
    with scipy.io.netcdf_file(path, "w", version=version) as file:
        file.createDimension("time", N)
        time, x = file.createVariable("time", "d", ("time",)), file.createVariable("x", "i", ("time",))
        time[:], x[:] = 1e3 * T, np.round(1e9 * X)
        time.units = "milliseconds since 2020-01-01"
        x.units, x.scale_factor = "m", 1e-9
        for name, value in attributes.items():
            setattr(x, name, value)


WAVE = {"unit_string": "um", "wf_increment": 1 / 2000, "wf_start_offset": 0.0}
TWO = {
    f"Run {i}": [("Time", 1e3 * T, {"unit_string": "ms"}), ("x", 1e6 * X, WAVE | {"wf_increment": 0.0})] for i in (1, 2)
}


def test_a_waveform_of_labview(tmp_path):
    write_tdms(tmp_path / "run.tdms", {"Run": [("x", 1e6 * X, WAVE), ("v", X, {"unit_string": "m/s"})]})
    assert same(read(tmp_path / "run.tdms"))
    write_tdms(tmp_path / "run.tdms", {"Run": [("x", 1e6 * X, WAVE | {"wf_start_offset": 2.5})]})
    assert read(tmp_path / "run.tdms").t[0] == 2.5


def test_stamps_of_labview(tmp_path):
    stamps = np.datetime64("2024-01-01T10:00:00.000000") + (1e6 * T).astype("timedelta64[us]")
    words = ("operator", ["a"] * N)
    write_tdms(tmp_path / "run.tdms", {"Run": [("Time", stamps), ("x [um]", 1e6 * X), words]})
    record = read(tmp_path / "run.tdms")
    assert record.x == pytest.approx(X) and record.t == pytest.approx(T, abs=2e-9)


def test_groups_with_the_same_channels_are_runs(tmp_path):
    path = tmp_path / "two.tdms"
    write_tdms(path, TWO)
    with pytest.raises(DataError, match=r"two.tdms holds 2 runs; choose one with run=1, or run='all'"):
        read(path)
    assert same(read(path, run=2)) and read(path, run=2).name == "two.tdms, Run 2"
    assert all(same(record) for record in read(path, run="all"))
    assert same(read(path, column="Run 1/x"))


def test_groups_with_other_channels_are_none(tmp_path):
    write_tdms(tmp_path / "run.tdms", {"Run": [("x", 1e6 * X, WAVE)], "Room": [("temperature", X + 20)]})
    assert same(read(tmp_path / "run.tdms"))


@pytest.mark.parametrize("version", [1, 2])
def test_netcdf_of_version_3(tmp_path, version):
    write_netcdf(tmp_path / "run.nc", version)
    assert same(read(tmp_path / "run.nc"), rel=2e-5)
    write_netcdf(tmp_path / "run.nc", version, _FillValue=np.int32(round(1e9 * X[7])))
    assert np.flatnonzero(~read(tmp_path / "run.nc").mask).tolist() == [7]


def test_netcdf_of_other_versions(tmp_path):
    (tmp_path / "run.nc").write_bytes(b"CDF\x05" + bytes(100))
    with pytest.raises(DataError, match=r"run.nc is of version CDF-05, which is not read; convert it to netCDF-4"):
        read(tmp_path / "run.nc")


def test_parquet_takes_units_from_wherever_they_stand(tmp_path):
    path = tmp_path / "run.parquet"
    parquet.write_table(pa.table({"t [ms]": 1e3 * T, "x [um]": 1e6 * X}), path)
    assert same(read(path))
    fields = [
        pa.field("t", pa.float64(), metadata={"units": "ms"}),
        pa.field("x", pa.float64(), metadata={"unit": "um"}),
    ]
    parquet.write_table(pa.table([1e3 * T, 1e6 * X], schema=pa.schema(fields)), path)
    assert same(read(path))
    Record(T, X).to_dataframe().to_parquet(path)
    assert same(read(path))


def test_parquet_holds_durations_decimals_and_gaps(tmp_path):
    path = tmp_path / "run.pq"
    x = pa.array([None if i == 5 else f"{value:.12f}" for i, value in enumerate(1e3 * X)]).cast(pa.decimal128(20, 12))
    parquet.write_table(pa.table({"t": pa.array(pd.to_timedelta(T, unit="s")), "x [mm]": x, "note": ["a"] * N}), path)
    record = read(path)
    assert record.t == pytest.approx(T, abs=1e-15)
    assert np.flatnonzero(~record.mask).tolist() == [5]
    assert record.x[record.mask] == pytest.approx(np.delete(X, 5), abs=1e-15)


def test_parquet_of_any_packing(tmp_path):
    table = pa.table({"t [s]": T, "x [m]": X, "state": ["ok"] * N, "several": [[1.0, 2.0]] * N})

    def check(packing, options):
        parquet.write_table(table, tmp_path / "run.parquet", compression=packing, **options)
        assert same(read(tmp_path / "run.parquet"))

    layouts = [{"data_page_version": "2.0"}, {"row_group_size": 7, "data_page_size": 8}]
    check_rows(check, itertools.product(["none", "snappy", "gzip", "zstd", "lz4"], layouts))


def test_runs_one_below_the_other(tmp_path):
    path = tmp_path / "runs.parquet"
    table = pd.DataFrame({"run": np.repeat([3, 7], N), "t [s]": np.tile(T, 2), "x [m]": np.tile(X, 2)})
    table.to_parquet(path)
    with pytest.raises(DataError, match=r"runs.parquet holds 2 runs; choose one with run=3"):
        read(path)
    assert same(read(path, run=7)) and read(path, run=7).name == "runs.parquet, run 7"
    assert len(read(path, run="all")) == 2
    table.iloc[::-1].sort_values("t [s]").to_parquet(path)
    with pytest.raises(DataError, match="the rows of one 'run' lie apart; sort them by run and time"):
        read(path)


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_files(tmp_path, binary):
    path = tmp_path / "run.uff"
    write_uff(path, binary)
    assert same(read(path), rel=1e-11)
    assert read(path).meta["columns"]["x"] == "displacement 3 +Z"
    write_uff(path, binary, sets=2)
    with pytest.raises(DataError, match=r"run.uff holds 2 runs"):
        read(path)
    assert same(read(path, run=2), rel=1e-11)


def test_universal_files_of_other_functions(tmp_path):
    write_uff(tmp_path / "frf.unv", 0, func_type=4)
    with pytest.raises(DataError, match=r"frf.unv holds no time response \(data set 58\)"):
        read(tmp_path / "frf.unv")


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_mdf(tmp_path, compression):
    path = tmp_path / "run.mf4"
    signals = [("x", 1e6 * X, "um"), ("v", X, "m/s")]
    write_mdf(path, [signals], compression)
    assert same(read(path))
    write_mdf(path, [signals, signals[:1]], compression)
    with pytest.raises(DataError, match=r"run.mf4 holds 2 runs"):
        read(path)
    assert same(read(path, run=2)) and same(read(path, column="Group 1/x"))


def test_mdf_converts_by_numbers_but_not_by_formulas(tmp_path):
    path = tmp_path / "run.mf4"
    counts = np.round(1e9 * X).astype(np.int32)
    conversions: list[tuple[dict[str, object], str]] = [
        ({"a": 1e-3, "b": 0.0}, ""),
        ({"formula": "X1*2"}, "by a table or a formula, which is not"),
    ]
    for conversion, words in conversions:
        with MDF(version="4.10") as file:
            file.append([Signal(counts, T, name="x", unit="um", conversion=conversion)])
            file.save(path, overwrite=True)
        if words:
            with pytest.raises(DataError, match=words):
                read(path, column="x")
        else:
            assert same(read(path), rel=2e-5)


def test_mdf_of_version_3(tmp_path):
    (tmp_path / "run.mdf").write_bytes(b"MDF     3.30    " + bytes(100))
    with pytest.raises(DataError, match=r"run.mdf is of version 3.30; convert it to MDF 4"):
        read(tmp_path / "run.mdf")


EXTRAS = [
    ("tdms", "nptdms", "tdms"),
    ("parquet", "pyarrow.parquet", "parquet"),
    ("uff", "pyuff", "uff"),
    ("mf4", "asammdf", "mdf"),
]


def test_a_missing_extra(tmp_path, monkeypatch):
    def check(suffix, module, extra):
        (tmp_path / f"run.{suffix}").write_bytes(b"MDF     4.10    " + bytes(100))
        (tmp_path / f"{module.split('.')[0]}.py").write_text("raise ImportError")
        # Another thread starts another reading process, with the new path.
        reading = pool.submit(read, tmp_path / f"run.{suffix}")
        with pytest.raises(UsageError, match=rf"needs the package \w+: pip install 'fricjax\[{extra}\]'"):
            reading.result()

    monkeypatch.syspath_prepend(tmp_path)
    with ThreadPoolExecutor(1) as pool:
        check_rows(check, EXTRAS)


def test_damaged_files(tmp_path):
    def check(suffix):
        (tmp_path / f"run.{suffix}").write_bytes(b"garbage" * 100)
        with pytest.raises(DataError, match=rf"run.{suffix} (cannot be read as|holds no time response)"):
            read(tmp_path / f"run.{suffix}")

    check_rows(check, ["tdms", "nc", "parquet", "uff", "mf4"])
