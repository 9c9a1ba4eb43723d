"""Text, NumPy, MATLAB and HDF5 files give the same record."""

import re

import h5py
import numpy as np
import pytest
import scipy.io

from fricjax.data import read
from fricjax.errors import DataError, UsageError
from tests.tables import check_rows

T = np.arange(6) * 0.5e-3
X = np.array([2.0, 1.5, 1.0, 0.25, -0.5, -1.125]) * 1e-3


def same(record, quantity="m"):
    assert record.trace.t == pytest.approx(T, rel=1e-14)
    assert record.trace.x == pytest.approx(X, rel=1e-14)
    assert record.quantity == quantity
    return True


# --- text


def table(*, delimiter=",", decimal=".", header=None, t_scale=1.0, x_scale=1.0, before="", end="\n"):
    rows = [f"{a * t_scale:.10g}{delimiter}{b * x_scale:.10g}" for a, b in zip(T, X, strict=True)]
    if decimal != ".":
        rows = [row.replace(".", decimal) for row in rows]
    return before + end.join([*([header] if header else []), *rows]) + end


DIALECTS = {
    "comma": (table(), {}),
    "no end of line": (table().rstrip("\n"), {}),
    "windows": (table(end="\r\n", header="t,x"), {}),
    "tab": (table(delimiter="\t", header="Time\tPosition"), {}),
    "blanks": (table(delimiter="   ", header="  t   x"), {}),
    "semicolon and decimal comma": (table(delimiter=";", decimal=",", header="Zeit;Weg"), {}),
    "tab and decimal comma": (table(delimiter="\t", decimal=","), {}),
    "brackets": (table(header="Time [ms],Displacement [um]", t_scale=1e3, x_scale=1e6), {}),
    "parentheses": (table(header='"Time (ms)","Displacement (nm)"', t_scale=1e3, x_scale=1e9), {}),
    "slash": (table(header="t/ms,x/mm", t_scale=1e3, x_scale=1e3), {}),
    "blank header with units": (table(delimiter=" ", header="t [ms] x [mm]", t_scale=1e3, x_scale=1e3), {}),
    "row of units": (table(header="Time,Position\nms,mm", t_scale=1e3, x_scale=1e3), {}),
    "remarked header": (table(before="# t [ms], x [mm]\n", t_scale=1e3, x_scale=1e3), {}),
    "micro sign": (table(header="Time [s];x [µm]", delimiter=";", x_scale=1e6), {}),
    "preamble": (table(before="Recorder 7\nrun 12, 3 mm\n\n", header="t,x"), {}),
    "skipped rows": (table(before="1,2\n7,8\n"), {"skip_rows": 2}),
    "remarks": (table(before="% made by hand\n! twice\n", header="t,x"), {}),
    "own remark": (table(before="REM nothing\n", header="t,x"), {"comment": "REM"}),
    "given units": (table(t_scale=1e3, x_scale=1e6), {"unit": "um", "time_unit": "ms"}),
    "given dialect": (
        table(delimiter=";", decimal=","),
        {"delimiter": "semicolon", "decimal": ",", "header": False, "encoding": "utf-8"},
    ),
    "one column": ("\n".join(f"{x:.10g}" for x in X), {"rate": 2000}),
    "one column, decimal comma": ("\n".join(f"{x:.10f}".replace(".", ",") for x in X), {"rate": 2000, "decimal": ","}),
    "head of other width": ("angle, rate\n90, 1000\n" + "\n".join(f"{x:.10g}" for x in X), {"rate": 2000}),
    "flipped": (table(x_scale=-1), {"sign": -1}),
    "trailing delimiter": ("\n".join(f"{a:.10g},{b:.10g}," for a, b in zip(T, X, strict=True)), {}),
    "third column": ("\n".join(["t,v,x", *(f"{a:.10g},7,{b:.10g}" for a, b in zip(T, X, strict=True))]), {}),
    "by name": ("\n".join(["t,a,b", *(f"{a:.10g},7,{b:.10g}" for a, b in zip(T, X, strict=True))]), {"column": "B"}),
    "by index": ("\n".join(f"7,{b:.10g},{a:.10g}" for a, b in zip(T, X, strict=True)), {"column": 1, "time": 2}),
    "by index as text": ("\n".join(f"{a:.10g},7,{b:.10g}" for a, b in zip(T, X, strict=True)), {"column": "2"}),
}


@pytest.mark.parametrize("suffix", ["csv", "txt"])
def test_dialects(tmp_path, suffix):
    path = tmp_path / f"run.{suffix}"

    def check(text, options):
        path.write_bytes(text.encode())
        assert same(read(path, **options))

    check_rows(check, DIALECTS)


def test_encodings(tmp_path):
    path = tmp_path / "run.csv"

    def check(encoding):
        path.write_bytes(table(header="Time [ms],x [µm]", t_scale=1e3, x_scale=1e6).encode(encoding))
        assert same(read(path))

    check_rows(check, ["latin-1", "utf-8-sig", "utf-16"])


def test_degrees_become_radians(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(table(header="t,angle [deg]"))
    record = read(path)
    assert record.quantity == "rad"
    assert record.trace.x == pytest.approx(np.deg2rad(X))


def test_time_keeps_its_origin_and_spacing(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("60.0,1\n60.5,2\n60.6,3\n62,4\n")
    assert read(path).trace.t.tolist() == [60.0, 60.5, 60.6, 62.0]


def test_gaps_are_masked_and_counted(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,x\n0,1\n1,NaN\n2,\n3,4\n4,nan\n5,6\n6,7\n")
    record = read(path)
    assert record.trace.mask.tolist() == [True, False, False, True, False, True, True]
    assert "3 samples without a value masked in 2 gaps" in record.log[0].effect


def test_sigma_is_in_the_unit_of_the_displacement(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(table(x_scale=1e6))
    assert read(path, unit="um", sigma=0.005).trace.sigma == pytest.approx(5e-9)


def test_a_preamble_states_the_unit_of_a_single_column(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("# instrument: X\n# unit: um\n" + "\n".join(f"{x:.4f}" for x in range(8)))
    assert np.asarray(read(path, rate=1e4).trace.x) == pytest.approx(1e-6 * np.arange(8))


def test_between_quotes_a_comma_marks_decimals(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text('"time, s","x, mm"\n' + "".join(f'"0,{i:04}","1,{i:03}"\n' for i in range(50)))
    record = read(path)
    assert np.asarray(record.trace.t) == pytest.approx(1e-4 * np.arange(50))
    assert np.asarray(record.trace.x) == pytest.approx(1e-3 + 1e-6 * np.arange(50))


# Text of the file, options, and part of the message.
BAD_TEXT = {
    "word in the data": ("t,x\n0,1\n1,2\n2,oops\n3,4\n", {}, "run.csv, row 4, column 'x': 'oops' is not a number"),
    "word in the time": ("t,x\n0,1\n\n# note\n1,2\nlate,3\n3,4\n", {}, "row 6, column 't': 'late' is not a number"),
    "NaN in the time": ("t,x\n0,1\n1,2\nnan,3\n3,4\n", {}, "column 't', row 4: the time is nan"),
    "time goes back": ("t,x\n0,1\n2,2\n1.5,3\n3,4\n", {}, "row 4: the time is not increasing (1.5 after 2.0)"),
    "time repeats": ("0,1\n1,2\n1,3\n3,4\n", {}, "row 3: the time is not increasing (1.0 after 1.0)"),
    "runs below each other": ("t,x\n0,1\n1,2\n2,3\n0,1\n1,2\n", {}, "it starts again there, as if a second run"),
    "volts": ("Second,Volt\n0,1\n1,2\n2,3\n", {}, "'Volt' of run.csv is in Volt, which only a scale makes"),
    "too many fields": ("t,x\n0,1\n1,2\n2,3,4\n3,4\n", {}, "row 4: 3 fields, but 2 were expected"),
    "two samples": ("t,x\n0,1\n1,2\n", {}, "holds 2 usable samples in 'x', but a trace needs at least 3"),
    "no time": ("1\n2\n3\n4\n", {}, "has no time for 'column0'; give rate="),
    "unknown column": ("time,displacement\n0,1\n1,2\n2,3\n", {"column": "displacment"}, "Did you mean 'displacement'"),
    "unknown time": ("time,x\n0,1\n1,2\n2,3\n", {"time": "tine"}, "(given by time=). Did you mean 'time'"),
    "index too large": ("0,1\n1,2\n2,3\n", {"column": 5}, "has 2 columns, but column=5"),
    "ambiguous": ("t,a,b\n0,1,1\n1,2,2\n2,3,3\n", {}, "several columns that could be the displacement ('a', 'b')"),
    "unfit unit": ("t,x [kg]\n0,1\n1,2\n2,3\n", {}, "The unit 'kg' does not fit the displacement 'x' of run.csv"),
    "unfit given unit": ("0,1\n1,2\n2,3\n", {"unit": "ms"}, "units that fit are 'm', 'mm', 'um' or 'nm' or 'rad'"),
    "unfit time unit": ("0,1\n1,2\n2,3\n", {"time_unit": "mm"}, "'mm' does not fit the time"),
    "no unit at all": ("0,1\n1,2\n2,3\n", {"unit": "parsec per"}, "'parsec per' is not a known unit"),
    "a mere number": ("0,1\n1,2\n2,3\n", {"unit": "percent"}, "'percent' does not fit"),
    "no numbers": ("hello\nworld\n", {}, "holds no rows of numbers"),
    "a note": ("It stuck, see page 17 of the notebook.\nAgain on Monday.\n", {}, "holds no rows of numbers"),
    "only remarks": ("# hello\n\n", {}, "holds no data"),
    "binary": ("\x00\x01\x02\x03" * 50, {}, "is binary, not text"),
    "empty": ("", {}, "run.csv is empty"),
}


def test_bad_text(tmp_path):
    path = tmp_path / "run.csv"

    def check(text, options, message):
        path.write_text(text)
        with pytest.raises(DataError, match=re.escape(message)):
            read(path, **options)

    check_rows(check, BAD_TEXT)


WRONG_OPTIONS = [
    ({"colum": "x"}, "colum= is no option for .csv files. Did you mean 'column='"),
    ({"rate": 0}, "rate must be a positive number"),
    ({"rate": 5, "time": "t"}, "either time= .* or rate="),
    ({"sign": 2}, "sign must be 1 or -1"),
    ({"decimal": "x"}, "decimal must be"),
    ({"skip_rows": -1}, "skip_rows must not be negative"),
    ({"delimiter": ",", "decimal": ","}, "cannot both be"),
    ({"encoding": "klingon"}, "no known text encoding"),
]


def refused(path, error, rows):
    """Check that a file is refused with the options of each row."""

    def check(options, message):
        with pytest.raises(error, match=message):
            read(path, **options)

    check_rows(check, {message: (options, message) for options, message in rows})


def test_wrong_options(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(table(header="t,x"))
    refused(path, UsageError, WRONG_OPTIONS)


def test_missing_and_unknown_files(tmp_path):
    (tmp_path / "run1.csv").write_text(table())
    (tmp_path / "run.xyz").write_text(table())
    with pytest.raises(DataError, match=r"There is no file .*run2.csv. Did you mean 'run1.csv'"):
        read(tmp_path / "run2.csv")
    with pytest.raises(DataError, match=r"unknown format: it has the suffix '.xyz', and known are .csv"):
        read(tmp_path / "run.xyz")
    with pytest.raises(DataError, match="is a folder"):
        read(tmp_path)


# --- npz


def test_npz(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, t=T, x=X * 1e6, other=np.zeros(3), label=np.array("a"))
    assert same(read(path, unit="um"))
    assert same(read(path, column="x", time="t", unit="um"))
    assert read(path, column="x", rate=2000, unit="um").trace.t == pytest.approx(T)


def test_bad_npz(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, t=T, x=X)
    with pytest.raises(DataError, match="has no column 'displ'"):
        read(path, column="displ")
    np.savez(path, x=X)
    with pytest.raises(DataError, match="no time for 'x'; give rate="):
        read(path)
    np.savez(path, t=T[:4], x=X)
    with pytest.raises(DataError, match="'t' has 4 samples and 'x' has 6"):
        read(path)
    np.savez(path, t=T, x=np.zeros((6, 2)))
    with pytest.raises(DataError, match=r"several columns that could be the displacement \('x\[0\]', 'x\[1\]'\)"):
        read(path)
    np.savez(path, t=np.array([{}], dtype=object), x=X, allow_pickle=True)
    with pytest.raises(DataError, match="pickled objects"):
        read(path)
    path.write_bytes(b"garbage" * 20)
    with pytest.raises(DataError, match=r"cannot be read as \.npz"):
        read(path)


# --- MATLAB


def simulink():
    """Return Simulink's "structure with time": time and signals.values."""
    return {"time": T[:, None], "signals": {"values": X[:, None], "dimensions": 1.0, "label": "x"}, "blockName": "m/x"}


def cells(*parts):
    array = np.empty((len(parts), 1), dtype=object)
    array[:, 0] = parts
    return array


VARIABLES = {
    "t": T[:, None],
    "x": X[None, :],
    "run": {"x": X[:, None], "clock": {"t": T[:, None]}},
    "Theta1": simulink(),
    "Time_a": cells(T[:2, None], T[2:4, None]),
    "Time_b": cells(T[4:, None]),
    "Y_a": cells(np.stack([X[:2], 7 * X[:2]]), np.stack([X[2:4], 7 * X[2:4]])),
    "Y_b": cells(np.stack([X[4:], 7 * X[4:]])),
    "both": np.stack([7 * X, X]),
    "label": "a run",
}

CHOICES = {
    "usual names": {},
    "names": {"column": "x", "time": "t"},
    "fields": {"column": "run.x", "time": "run.clock.t"},
    "structure with time": {"column": "Theta1"},
    "values and time": {"column": "Theta1.signals.values", "time": "Theta1.time"},
    "cells": {"column": "Y_a+Y_b", "time": "Time_a+Time_b"},
    "list of cells": {"column": ["Y_a[0]", "Y_a[1]", "Y_b"], "time": ["Time_a", "Time_b"]},
    "row": {"column": "both", "time": "t", "row": 1},
    "rate": {"column": "x", "rate": 2000},
}


def save_hdf5(path, variables):
    """Write a file of version 7.3 in the layout of MATLAB.

    It has a leading block of text, reversed dimensions, and references for cells.
    """
    with h5py.File(path, "w", userblock_size=512) as file:
        heap = file.create_group("#refs#")
        for name, value in variables.items():
            _put(file, heap, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")


def _put(folder, heap, name, value):
    if isinstance(value, dict):
        group = folder.create_group(name)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for key, child in value.items():
            _put(group, heap, key, child)
    elif isinstance(value, str):
        node = folder.create_dataset(name, data=np.array([[ord(letter)] for letter in value], dtype=np.uint16))
        node.attrs["MATLAB_class"] = np.bytes_("char")
    elif isinstance(value, np.ndarray) and value.dtype == object:
        references = [_put(heap, heap, f"r{len(heap)}", item).ref for item in value.ravel()]
        node = folder.create_dataset(name, data=np.array([references], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        node.attrs["MATLAB_class"] = np.bytes_("cell")
    else:
        node = folder.create_dataset(name, data=np.atleast_2d(value).T)
        node.attrs["MATLAB_class"] = np.bytes_("double")
        return node
    return folder[name]


@pytest.fixture(params=["v5", "v7.3"])
def mat(request, tmp_path):
    path = tmp_path / "run.mat"
    if request.param == "v5":
        scipy.io.savemat(path, VARIABLES)
    else:
        save_hdf5(path, VARIABLES)
    return path


def test_mat(mat):
    def check(options):
        assert same(read(mat, **options))

    check_rows(check, CHOICES)


def test_some_cells(mat):
    record = read(mat, column="Y_a", time="Time_a", cells=[1, 0][::-1])
    assert record.trace.x == pytest.approx(X[:4])
    rate = read(mat, column="Y_a", rate=10, cells=[1, 0])
    assert rate.trace.x == pytest.approx([*X[2:4], *X[:2]])


BAD_CHOICES = [
    ({"column": "Theta"}, r"has no column 'Theta' .* Did you mean 'Theta1'"),
    ({"column": "Theta1.signal.values"}, "Did you mean 'signals'"),
    ({"column": "run"}, "is a structure; name one of its fields: .*clock"),
    ({"column": "label"}, "'label' in run.mat holds text, so it is no displacement"),
    ({"column": "Y_a[4]", "time": "t"}, r"'Y_a' has 2 cells, but column= asks for \[4\]"),
    ({"column": "both", "time": "t", "row": 3}, "holds 2 signals, but row=3"),
    ({"column": "Y_a", "time": "Time_a", "cells": [7]}, "has 2 cells, but cells= asks for 7"),
    ({"column": "Y_a", "time": "t"}, "'t' has 6 samples and 'Y_a' has 4"),
    ({"column": "Y_a+Y_a", "time": "Time_a+Time_a"}, "the time is not increasing"),
]


def test_bad_choices_in_mat(mat):
    refused(mat, DataError, BAD_CHOICES)


def test_a_damaged_mat_file(tmp_path):
    path = tmp_path / "run.mat"
    for content in (b"garbage" * 100, b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\xff" * 80):
        path.write_bytes(content)
        with pytest.raises(DataError, match="cannot be read as a MATLAB file"):
            read(path)


# --- HDF5


@pytest.fixture
def hdf5(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for name in ("run1", "run2"):
            file[f"{name}/x"] = X * 1e6
            file[f"{name}/x"].attrs["units"] = "um"
            file[f"{name}/t"] = T * 1e3
            file[f"{name}/t"].attrs["units"] = "milliseconds since 2020-01-01"
        counts = np.array([-9999, *np.round(X[1:] * 1e6)], dtype=np.int32)
        scaled = file.create_dataset("scaled/y", data=counts)
        scaled.attrs.update({"scale_factor": 1e-6, "_FillValue": np.int32(-9999), "units": b"m"})
        axis = file.create_dataset("scaled/axis", data=T)
        axis.make_scale("axis")
        scaled.dims[0].attach_scale(axis)
        file["image"] = np.zeros((3, 4))
    return path


def test_hdf5(hdf5):
    assert same(read(hdf5, column="/run1/x"))
    assert same(read(hdf5, column="run2/x", time="/run2/t"))
    assert same(read(hdf5, column="/run1/x", rate=2000))


def test_cf_conventions(hdf5):
    record = read(hdf5, column="/scaled/y")
    assert record.trace.t == pytest.approx(T)
    assert record.trace.mask.tolist() == [False, True, True, True, True, True]
    assert record.trace.x[1:] == pytest.approx(X[1:])


def test_one_pair_needs_no_names(tmp_path):
    with h5py.File(tmp_path / "run.nc", "w") as file:
        file["t"], file["x"] = T, X
    assert same(read(tmp_path / "run.nc"))


BAD_HDF5 = [
    ({"column": "/run3/x"}, r"has no column '/run3/x' \(given by column=\). Did you mean '/run\dx?/x'"),
    ({"column": "/image", "rate": 5}, r"has no column '/image' .* Did you mean '/image\[\d\]'"),
    ({"column": "/scaled/axis"}, "has no time for '/scaled/axis'"),
    ({}, r"run.h5 holds 2 runs; choose one with run=1, or run='all'"),
    ({"column": "/run1/x", "unit": "kg"}, "'kg' does not fit"),
]


def test_bad_hdf5(hdf5):
    refused(hdf5, DataError, BAD_HDF5)


def test_damaged_hdf5(tmp_path):
    path = tmp_path / "run.h5"
    path.write_bytes(b"garbage" * 100)
    with pytest.raises(DataError, match="cannot be read as HDF5"):
        read(path)
