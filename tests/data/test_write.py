"""Records are read back bit for bit, and no half-written file remains."""

import json
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fricjax.data import Record, Step, Trace, read, write
from fricjax.errors import DataError, UsageError
from tests.helpers import largest

SUFFIXES = ["csv", "npz", "h5", "hdf5"]
numbers = st.floats(-1e3, 1e3, allow_subnormal=True)


@st.composite
def records(draw):
    n = draw(st.integers(3, 12))
    t = np.cumsum(draw(st.lists(st.floats(1e-6, 10.0), min_size=n, max_size=n)))
    x = draw(st.lists(st.one_of(numbers, st.just(np.nan)), min_size=n, max_size=n))
    positive = st.floats(1e-12, 1.0)
    sigma = draw(st.one_of(st.none(), positive, st.lists(positive, min_size=n, max_size=n)))
    mask = np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)))
    meta = {"source": draw(st.text()), "quantity": draw(st.sampled_from(["m", "rad"])), "release_time": draw(numbers)}
    log = tuple(Step(draw(st.text()), {"a": draw(numbers), "b": None}, draw(st.text())) for _ in range(2))
    return Record(Trace(t, x, sigma, mask), meta, log)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(record=records())
def test_round_trip(tmp_path_factory, suffix, record):
    path = tmp_path_factory.mktemp("run") / f"run.{suffix}"
    again = read(write(record, path))
    for name in ("t", "x", "mask"):
        assert np.array_equal(getattr(again.trace, name), getattr(record.trace, name))
    if record.trace.sigma is None or again.trace.sigma is None:
        assert record.trace.sigma is again.trace.sigma
    else:
        assert np.array_equal(again.trace.sigma, record.trace.sigma)
        assert again.trace.sigma.shape == record.trace.sigma.shape
    assert (again.meta, again.log) == (record.meta, record.log)


@pytest.fixture
def record():
    trace = Trace(np.arange(4) * 0.1, [1.0, np.nan, 0.5, 0.2], 1e-3)
    return Record(trace, {"source": "a.csv", "quantity": "rad"}, (Step("read", {}, "4 samples"),))


def test_the_table_is_for_any_program(record, tmp_path):
    lines = write(record, tmp_path / "run.csv").read_text().splitlines()
    table = [line for line in lines if not line.startswith("#")]
    assert table[0] == "Time [s],Displacement [rad],Used"
    assert table[2] == "0.1,nan,0"
    assert json.loads(lines[2].removeprefix("# meta: "))["source"] == "a.csv"
    chosen = read(tmp_path / "run.csv", column="Displacement")
    assert chosen.quantity == "rad"
    assert chosen.trace.mask.tolist() == [True, False, True, True]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_noise_and_direction_may_be_given_anew(record, tmp_path, suffix):
    again = read(write(record, tmp_path / f"run.{suffix}"), sigma=2e-3, sign=-1)
    assert again.meta == record.meta
    assert again.trace.sigma == 2e-3
    assert np.array_equal(again.trace.x, -record.trace.x)
    assert [step.name for step in again.log] == ["read", "read"]


def test_hdf5_carries_units(record, tmp_path):
    with h5py.File(write(record, tmp_path / "run.h5")) as file:
        nodes: Any = file
        assert [nodes[name].attrs["units"] for name in ("t", "x", "sigma")] == ["s", "rad", "rad"]
        assert nodes["x"].dims[0][0].name == "/t"
    assert read(tmp_path / "run.h5", column="x").quantity == "rad"


def test_an_existing_file_is_replaced_or_kept_whole(record, tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")
    monkeypatch.setattr(np, "savez_compressed", lambda *_, **__: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        write(record, path, overwrite=True)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.npz"]


@pytest.mark.parametrize("suffix", [*SUFFIXES, "NPZ"])
def test_a_file_goes_only_where_it_may_and_where_there_is_space(record, tmp_path, suffix):
    path = tmp_path / f"run.{suffix}"
    path.write_text("old")
    with pytest.raises(FileExistsError, match="exists already; give overwrite=True, or another name"):
        write(record, path)
    with largest(50), pytest.raises(OSError, match="no space left") as caught:
        write(record, path, overwrite=True)
    assert caught.value.filename == str(path)
    assert path.read_text() == "old"
    assert read(write(record, path, overwrite=True)).meta == record.meta
    assert list(tmp_path.iterdir()) == [path]


def test_where_nothing_can_be_written(record, tmp_path):
    with pytest.raises(UsageError, match=r"cannot be written as '\.xlsx'; use one of \.csv"):
        write(record, tmp_path / "run.xlsx")
    with pytest.raises(UsageError, match="There is no folder"):
        write(record, tmp_path / "none" / "run.csv")
    with pytest.raises(DataError, match="cannot be written as JSON"):
        write(Record(record.trace, {"key": object()}), tmp_path / "run.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", ["csv", "npz", "h5"])
def test_damaged_and_future_records(record, tmp_path, suffix, monkeypatch):
    path = write(record, tmp_path / f"run.{suffix}")
    monkeypatch.setattr("fricjax.data.native.SCHEMA", 0)
    with pytest.raises(DataError, match="of schema 1, but this version reads up to 0"):
        read(path)


def test_a_damaged_text_record(record, tmp_path):
    path = write(record, tmp_path / "run.csv")
    path.write_text(path.read_text().replace("0.5,1", "0.5"))
    with pytest.raises(DataError, match="claims to be a fricjax record, but its table is damaged"):
        read(path)
    path.write_text("\n".join(line for line in path.read_text().splitlines() if not line.startswith("# log")))
    with pytest.raises(DataError, match="damaged"):
        read(path)
