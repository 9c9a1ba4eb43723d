"""`fricjax energy`: friction against velocity, and in half-cycles."""

import json
import shutil

import pytest

import fricjax as fj
from fricjax.data.read import example_paths

RUN, RIG = example_paths()
TRUTH = fj.read(RUN).meta["coefficients"]


def test_energy_prints_and_draws(fricjax, tmp_path):
    files = {"plot": tmp_path / "map.png", "out": tmp_path / "map.json"}
    words = [word for name, path in files.items() for word in (f"--{name}", path)]
    called = fricjax("energy", RUN, "--rig", RIG, "--bins", "10", *words)
    assert called.code == 0
    assert "coefficient of friction" in called.out
    assert "+ accelerating" in called.out
    assert files["plot"].read_bytes().startswith(b"\x89PNG")
    written = json.loads(files["out"].read_text())
    assert written["force_map"]["mu"]["value"] == pytest.approx(TRUTH["mu"], rel=1e-3)


def test_energy_as_json_holds_the_truth(fricjax, tmp_path):
    again = shutil.copy(RUN, tmp_path)
    called = fricjax("energy", RUN, again, "--rig", RIG, "--json")
    assert (called.code, called.err) == (0, "")
    report = json.loads(called.out)
    mean = report["half_cycles"]["mean"]
    assert abs(mean["value"] - TRUTH["mu"] * TRUTH["normal_force"]) < 5 * mean["std"]
    assert report["half_cycles"]["mu"]["std"] > mean["std"] / TRUTH["normal_force"]
    assert len(report["force_map"]["offsets"]) == 2
    assert report["files"] == {}


def test_energy_needs_a_rig(fricjax):
    called = fricjax("energy", RUN)
    assert called.code == 2
    assert "give --rig rig.toml" in called.err


def test_energy_needs_the_damping_of_the_rig(fricjax, tmp_path):
    path = tmp_path / "rig.toml"
    fj.Rig(mass=0.41068, stiffness=2574.0, normal_force=9.66).to_toml(path)
    called = fricjax("energy", RUN, "--rig", path)
    assert called.code == 2
    assert "The rig has no damping" in called.err


def test_too_short_a_run_is_rejected(fricjax):
    called = fricjax("energy", RUN, "--rig", RIG, "--crop", "0:0.07")
    assert called.code == 4
    assert "At least 2 are needed" in called.err or "never turns round" in called.err
