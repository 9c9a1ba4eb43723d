"""Damaged and hostile files are refused or read within limits."""

import os
import subprocess
import sys
import types
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from experiments.files.hostile import FILES, verdict
from experiments.files.mutate import mutated
from experiments.files.outcome import attempt
from experiments.files.seeds import SEEDS, N, T, X, write_seeds
from fricjax import read
from fricjax.calibrate.frf import read_frf
from fricjax.data.gather import gather
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
    path = tmp_path / "virtual.h5"
    FILES["HDF5"]["virtual.h5"][0](path)
    with pytest.raises(DataError, match="in another file"):
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
    "sparse": scipy.sparse.csc_matrix(np.diag(X)),
    "structs": np.array([(1.0, "x"), (2.0, "y")], dtype=[("p", object), ("q", object)]),
}


REASONS = {
    "complex": "complex",
    "sparse": "is a sparse matrix",
    "text": "text",
    "none": "text",
    "struct": "is a structure; name one of its fields: 'a', 'b'",
    "block": "has shape",
}


@pytest.mark.parametrize("options", [{}, {"do_compression": True}, {"format": "4"}], ids=["v5", "packed", "v4"])
def test_matlab_variables_of_all_types_are_found(tmp_path, options):
    path = tmp_path / "all.mat"
    names = ("real", "complex", "text") if "format" in options else VARIABLES
    scipy.io.savemat(path, {"t": T, "x": X} | {name: VARIABLES[name] for name in names}, **options)
    assert read(path, column="real", rate=1.0, unit="m").x.tolist() == [0.0, 1.0, 2.0]
    assert np.array_equal(read(path, column="x", unit="m").x, X)
    for name, reason in REASONS.items():
        if name in names:
            with pytest.raises(DataError, match=reason):
                read(path, column=name, rate=1.0, unit="m")


def test_archives_of_all_layouts_are_read(tmp_path):
    arrays = {
        "t": T.astype(">f8"),
        "x_m": np.stack([X, -X], axis=1).T,
        "text": np.array("a"),
        "empty": np.zeros((0, 2)),
    }
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    assert np.array_equal(read(tmp_path / "a.npz", column="x[1]").x, -X)


def test_a_crash_does_not_affect_the_next_file(tmp_path):
    for name in ("too_short.h5", "heap_zero.h5"):
        FILES["HDF5"][name][0](tmp_path / name)
        with pytest.raises(DataError, match=r"crashed|takes more than"):
            read(tmp_path / name)
        SEEDS["plain.h5"](tmp_path / "good.h5")
        assert read(tmp_path / "good.h5").trace.n == N


def test_a_forked_process_and_a_thread_read_on_their_own(tmp_path):
    SEEDS["stored.npz"](tmp_path / "a.npz")
    assert read(tmp_path / "a.npz").trace.n == N
    with ThreadPoolExecutor(2) as pool:
        lengths = pool.map(lambda path: len(read(path)), [tmp_path / "a.npz"] * 8)
    assert list(lengths) == [N] * 8
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        child = os.fork()
    if child == 0:
        os._exit(0 if read(tmp_path / "a.npz").trace.n == N else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert read(tmp_path / "a.npz").trace.n == N


def test_values_are_shown_in_brief():
    assert brief("a") == "'a'"
    assert len(brief("a" * 5000)) < 100 and len(brief([[[[[1]]]]] * 5000)) < 300
    assert brief(16**9999) == "a number of thousands of digits"
    assert brief(types.SimpleNamespace(a="b" * 500)).startswith("namespace")
