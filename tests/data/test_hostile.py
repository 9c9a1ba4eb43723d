"""Damaged and hostile files are refused or read within limits."""

import os
import subprocess
import sys
import types
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from experiments.files.hostile import FILES, verdict
from experiments.files.hostile_trees import KINDS, save_kinds
from experiments.files.mutate import mutated
from experiments.files.outcome import attempt
from experiments.files.seeds import SEEDS, write_seeds
from fricjax import read
from fricjax.calibrate.frf import read_frf
from fricjax.data import files as content_module
from fricjax.data.gather import gather
from fricjax.data.readers.matlab import Opaque, load_tree
from fricjax.data.readers.nodes import opened
from fricjax.data.readers.npz import load_arrays
from fricjax.errors import DataError, brief

ROOT = Path(__file__).resolve().parents[2]
QUICK_BOMBS = ("large5.mat", "bomb73.mat", "bytes.h5")


@pytest.mark.parametrize("kind", [kind for kind in FILES if kind != "bombs"])
def test_hostile_files_end_as_they_should(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    wrong = differences(tmp_path, FILES[kind])
    assert not wrong, wrong


def test_some_bombs_do_not_go_off(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = differences(tmp_path, {name: FILES["bombs"][name] for name in QUICK_BOMBS})
    assert not wrong, wrong


def differences(folder, files):
    """Read each file in a folder and return all unexpected outcomes."""
    ends = {name: verdict(folder, name, hostile) for name, hostile in files.items()}
    return {name: difference for name, (_, difference) in ends.items() if difference}


def test_a_refusal_of_one_reader_is_one_of_every_function_that_reads(tmp_path):
    path = tmp_path / "swells.h5"
    FILES["HDF5"]["swells.h5"][0](path)
    with pytest.raises(DataError, match=r"swells\.h5 is not read: its chunks are not of the size"):
        gather(path)


def run(script, *arguments):
    return subprocess.run(
        [sys.executable, str(ROOT / "experiments" / "files" / script), *arguments],
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.slow
def test_bombs_do_not_go_off():
    done = run("hostile.py", "bombs")
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{len(FILES['bombs'])} files, 0 not as expected" in done.stdout


@pytest.mark.slow
def test_random_damage_is_refused_or_read():
    done = run("fuzz.py", "--mutations", "300")
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 faults" in done.stdout


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    """Write a sound file of each format; return folder and contents."""
    folder = tmp_path_factory.mktemp("seeds")
    return folder, write_seeds(folder)


def test_some_random_damage_is_refused_or_read(tmp_path, monkeypatch, seeds):
    monkeypatch.chdir(tmp_path)
    _, contents = seeds
    faults = []
    for name, content in contents.items():
        # asammdf raises in a destructor when a damaged file is closed.
        for number in range(0 if name.endswith(".mf4") else 3):
            (tmp_path / name).write_bytes(mutated(name, content, number))
            outcome = attempt(tmp_path / name)
            if not outcome.sound:
                faults.append((name, number, outcome))
    assert not faults, faults


def test_the_seeds_themselves_are_sound(seeds):
    folder, _ = seeds
    records = [name for name in SEEDS if not name.endswith((".toml", ".json"))]
    assert {name: read(folder / name).trace.n for name in records} == dict.fromkeys(records, 40)


def test_a_path_that_is_none():
    for path in ("a\0b.csv", "\ud800.csv", "x" * 5000 + ".csv", "no/such/folder.csv"):
        with pytest.raises(DataError, match=r"is no name of a file|There is no file"):
            read(path)


def test_tables_of_receptances_are_files_as_well(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(DataError, match="is a device, a pipe or a socket"):
        read_frf(tmp_path / "pipe.csv")
    (tmp_path / "frf.csv").write_text("f [9**9**9**9 Hz],Re,Im\n" + "1,2,3\n" * 9)
    with pytest.raises(DataError, match=r"the unit '9\*\*9\*\*9\*\*9 Hz' does not fit"):
        read_frf(tmp_path / "frf.csv")


def test_what_is_no_displacement_comes_back_as_such(tmp_path):
    save_kinds(tmp_path / "kinds.mat")
    tree = load_tree(tmp_path / "kinds.mat")
    assert np.array_equal(tree["complex"], KINDS["complex"])
    assert tree["sparse"] == Opaque("a sparse matrix")
    assert tree["empty"].shape == (0, 0) and tree["cells"] == ["a", "b"]


VARIABLES = {
    "real": np.arange(6.0).reshape(2, 3),
    "single": np.array([[1.5]], np.float32),
    **{f"i{bits}": np.array([[-1, 2]], f"i{bits}") for bits in (1, 2, 4, 8)},
    **{f"u{bits}": np.array([[1], [2]], f"u{bits}") for bits in (1, 2, 4, 8)},
    "complex": np.array([[1 + 2j, 3.5j]]),
    "block": np.arange(24.0).reshape(2, 3, 4),
    "text": "Reibung µ",
    "lines": np.array(["ab", "cd"]),
    "none": "",
    "cells": np.array([[np.eye(2), "text"], [np.zeros((0, 0)), 5.0]], dtype=object),
    "struct": {"a": 1.0, "b": {"c": "deep", "d": np.arange(3)}},
    "structs": np.array([(1.0, "x"), (2.0, "y")], dtype=[("p", object), ("q", object)]),
}


def plain(value):
    """Convert values from scipy to dicts, lists, arrays and texts."""
    if value.dtype.names:
        structs = [{name: plain(item[name]) for name in value.dtype.names} for item in value.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype == object:
        return [plain(item) for item in value.ravel(order="F")]
    return (str(value.ravel()[0]) if value.size else "") if value.dtype.kind == "U" else value


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}], ids=["v5", "packed", "v4"])
def test_matlab_files_hold_what_scipy_finds_in_them(tmp_path, options):
    path = tmp_path / "all.mat"
    kinds = ("real", "complex", "text", "lines") if "format" in options else VARIABLES
    scipy.io.savemat(path, {name: VARIABLES[name] for name in kinds}, **options)
    expected = {name: plain(value) for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")}
    found = load_tree(path)
    assert list(found) == list(expected)
    np.testing.assert_equal(found, expected)


def test_a_part_that_is_too_large_does_not_hide_the_others(tmp_path, monkeypatch):
    scipy.io.savemat(tmp_path / "run.mat", {"film": np.zeros((100, 100)), "x": np.arange(5.0)})
    with h5py.File(tmp_path / "run73.mat", "w") as file:
        file["film"], file["x"] = np.zeros((100, 100)), np.arange(5.0)
    monkeypatch.setattr(content_module, "_ALWAYS", 1000)
    monkeypatch.setattr(content_module, "_PACKED", 0)
    for name in ("run.mat", "run73.mat"):
        tree = load_tree(tmp_path / name)
        assert "plausible for a file of this size" in tree["film"].kind
        assert np.array_equal(np.ravel(tree["x"]), np.arange(5.0))


def test_archives_hold_what_numpy_finds_in_them(tmp_path):
    arrays = {
        "a": np.arange(6).reshape(2, 3).T,
        "b": np.array("text"),
        "c": np.zeros((0, 2)),
        "d": np.arange(3, dtype=">i2"),
    }
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    found = load_arrays(tmp_path / "a.npz")
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype and np.array_equal(found[name], array)


def test_large_records_that_are_packed_well_are_read(tmp_path):
    """Twelve million equal numbers are a hundred times smaller on disk."""
    with h5py.File(tmp_path / "long.h5", "w") as file:
        file.create_dataset("x", data=np.zeros(12_000_000, "f4"), compression="gzip", chunks=(1 << 20,))
    with opened(tmp_path / "long.h5") as tree:
        assert tree.read(tree.data_sets()["/x"]).size == 12_000_000


def test_values_are_shown_in_brief():
    assert brief("a") == "'a'"
    assert len(brief("a" * 5000)) < 100 and len(brief([[[[[1]]]]] * 5000)) < 300
    assert brief(16**9999) == "a number of thousands of digits"
    assert brief(types.SimpleNamespace(a="b" * 500)).startswith("namespace")
