"""Quick benchmarks give every row and reach every optimum, without timing."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("numba")
pytest.importorskip("casadi")

COMMAND = Path(__file__).resolve().parents[2] / "experiments" / "benchmarks" / "run.py"
# Number of ratios between fricjax and a peer.
RATIOS = 12
# Limits in nm: a tenth of the noise for the peers, and less for the engines.
PEER_ERROR, ENGINE_ERROR = 0.5, 0.1
METHODS = {"fricjax", "fricjax, solve only", "numba closed form", "numba RK4", "CVODES", "odeint", "stock optimistix"}
METHODS |= {"numba closed form, own Jacobian", "stock optimistix, one by one"}
ENGINES = ("exact", "hybrid", "smooth")


def run(*arguments):
    return subprocess.run([sys.executable, str(COMMAND), *arguments], capture_output=True, text=True)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("benchmarks")
    done = run("--quick", "--json", str(folder / "out.json"), "--plot", str(folder / "out.png"))
    assert done.returncode == 0, done.stderr
    assert (folder / "out.png").stat().st_size > 10_000
    return json.loads((folder / "out.json").read_text()) | {"text": done.stdout}


@pytest.mark.slow
def test_every_ratio_has_both_sides(found):
    methods = {(row["workload"], row["method"]) for row in found["rows"]}
    targets = {(target["workload"], target["peer"]) for target in found["targets"]}
    assert len(targets) == RATIOS
    assert targets | {(workload, "fricjax") for workload, _ in targets} <= methods
    assert all(f"{workload}  " in found["text"] for workload, _ in targets)


@pytest.mark.slow
def test_every_fit_reaches_the_optimum(found):
    fits = [row for row in found["rows"] if row["excess"] is not None]
    assert {row["method"] for row in fits} == METHODS
    assert not [row for row in fits if row["reached"] < 1]


@pytest.mark.slow
def test_numerical_errors_are_below_the_noise(found):
    limits = {row["method"]: ENGINE_ERROR if row["method"] in ENGINES else PEER_ERROR for row in found["errors_nm"]}
    assert set(ENGINES) < set(limits)
    assert not [row for row in found["errors_nm"] if row["error"] > limits[row["method"]]]


@pytest.mark.slow
def test_the_long_record_is_fitted(found):
    assert [row["workload"] for row in found["long"]] == ["1e+05"]


def test_the_derivatives_of_the_closed_form_are_those_of_its_displacement(monkeypatch):
    monkeypatch.syspath_prepend(COMMAND.parent)
    closed = importlib.import_module("peers.closed_form")
    slopes = importlib.import_module("peers.closed_form_jacobian").slopes
    t, at = np.arange(4000) / 2e3, np.array([0.01, 0.2, 2574.0, 2e-3, 1e-5])
    for strokes in (3, 40):
        found = slopes(t, strokes, *at)
        for k, step in enumerate(np.diag(1e-6 * at)):
            ends = (closed.displacement(t, strokes, *(at + side * step)) for side in (1, -1))
            difference = np.subtract(*ends) / (2 * step[k])
            np.testing.assert_allclose(found[:, k], difference, atol=1e-6 * np.abs(difference).max())


def test_an_unknown_workload_is_refused():
    done = run("--quick", "--only", "rowling")
    assert done.returncode == 2
    assert "No workload is called 'rowling'" in done.stderr
