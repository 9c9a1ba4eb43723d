"""Each command prints its results, writes its files, and prints pure JSON."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

import fricjax as fj
from fricjax.data.read import example_paths
from fricjax.rig import Rig

RUN, RIG = example_paths()


@pytest.fixture(scope="module")
def demo(fricjax, tmp_path_factory):
    """Call the demonstration once."""
    folder = tmp_path_factory.mktemp("demo") / "made"
    return fricjax("demo", "--out", folder, "--json"), folder


def test_demo_writes_run_rig_fit_and_picture(demo):
    called, folder = demo
    assert (called.code, called.err) == (0, "")
    report = json.loads(called.out)
    assert sorted(path.name for path in folder.iterdir()) == ["fit.json", "fit.png", "rig.toml", "run.csv"]
    assert sorted(report["files"].values()) == sorted(str(path) for path in folder.iterdir())
    assert (folder / "run.csv").read_bytes() == RUN.read_bytes()
    assert (folder / "fit.png").read_bytes().startswith(b"\x89PNG")
    assert any(command.startswith("fricjax inspect") for command in report["next"])


def test_demo_finds_the_truth_within_its_uncertainties(demo):
    report = json.loads(demo[0].out)
    assert report["converged"]
    for name in ("mu", "damping", "stiffness"):
        assert abs(report["values"][name] - report["truth"][name]) < 4 * report["std_errors"][name]
    relative = Rig.from_toml(RIG).normal_force.relative
    assert report["combined_std_errors"]["mu"] >= relative * report["values"]["mu"]
    assert 0.9 < report["chi2_reduced"] < 1.1


def test_the_fit_that_demo_writes_can_be_loaded(demo):
    fit = fj.load_fit(demo[1] / "fit.json")
    assert fit.values["mu"] == json.loads(demo[0].out)["values"]["mu"]


def test_demo_refuses_a_folder_that_holds_something(demo, fricjax):
    called = fricjax("demo", "--out", demo[1])
    assert called.code == 2
    assert "is not empty. Name another with --out, or add --force" in called.err


def test_demo_says_what_to_type_next(demo, fricjax):
    called = fricjax("demo", "--out", demo[1], "--force", "--quiet")
    assert called.code == 0
    assert f"fricjax fit {demo[1] / 'run.csv'} --rig {demo[1] / 'rig.toml'}" in called.out
    assert "True" in called.out
    assert called.err == ""


def test_fit_with_a_rig_prints_and_writes(demo, fricjax, tmp_path):
    files = {"plot": tmp_path / "fit.svg", "out": tmp_path / "fit.json", "save": tmp_path / "record.npz"}
    words = [word for name, path in files.items() for word in (f"--{name}", path)]
    called = fricjax("fit", RUN, "--rig", RIG, *words)
    assert called.code == 0
    assert "mu " in called.out
    assert "status:      described" in called.out
    assert all(path.stat().st_size > 0 for path in files.values())
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in files.values())
    assert np.array_equal(fj.read(files["save"]).trace.x, fj.read(RUN).trace.x)


@pytest.mark.slow
def test_a_rig_file_holds_errors_of_the_instrument(fricjax, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG.read_text() + 'displacement_scale = "1 +/- 1e-2"\ntime_scale = "1 +/- 1e-6"\n')
    called = fricjax("fit", RUN, "--rig", rig, "--json")
    report = json.loads(called.out)
    parts = report["contributions"]["mu"]
    assert parts["displacement_scale"] == pytest.approx(1e-2 * report["values"]["mu"], rel=1e-3)
    assert report["combined_std_errors"]["mu"] == pytest.approx(
        np.hypot(report["std_errors"]["mu"], np.linalg.norm(list(parts.values())))
    )
    assert "mu: displacement_scale 96 % of the variance" in fricjax("fit", RUN, "--rig", rig).out


def test_fit_without_a_rig_gives_the_kinematics(fricjax):
    called = fricjax("fit", RUN)
    assert called.code == 0
    assert "natural frequency" in called.out
    assert "dead band" in called.out
    assert "Without a rig there is no mu: give --rig rig.toml" in called.out
    report = json.loads(fricjax("fit", RUN, "--json").out)
    assert not report["calibrated"] and not report["warnings"]
    truth = fj.read(RUN).meta["coefficients"]
    band = truth["mu"] * truth["normal_force"] / truth["stiffness"]
    for name, true in (("natural_frequency", 12.6), ("damping_ratio", 0.0027), ("dead_band", band)):
        found = report["kinematics"][name]
        assert abs(found["value"] - true) < 4 * found["std"], name


def test_gaps_are_masked_counted_and_fitted_around(fricjax, tmp_path):
    record = fj.read(RUN)
    x = np.asarray(record.trace.x).copy()
    x[1000:1040] = np.nan
    path = tmp_path / "gaps.csv"
    rows = [f"{float(t)!r},{1e3 * value!r}" for t, value in zip(record.trace.t, x.tolist(), strict=True)]
    path.write_text("\n".join(["Time [s],Displacement [mm]", *rows]))
    report = json.loads(fricjax("inspect", path, "--json").out)
    assert report["masked"] == 40
    assert "40 samples without a value masked in 1 gap" in report["log"][0]
    fitted = fricjax("fit", path, "--rig", RIG, "--json")
    assert fitted.code == 0
    assert json.loads(fitted.out)["values"]["mu"] == pytest.approx(0.02, rel=1e-5)


@pytest.mark.slow
def test_a_fit_that_does_not_describe_its_record_ends_with_three(fricjax, tmp_path):
    """A fringe slip within a half-cycle shifts the rest of the run."""
    run = fj.read(RUN)
    t, x = np.asarray(run.trace.t), np.asarray(run.trace.x)
    path, files = tmp_path / "slip.csv", {name: tmp_path / f"fit.{name}" for name in ("json", "png")}
    rows = np.column_stack([t, np.where(np.arange(t.size) < 1500, x, x + 316.4e-9)])
    np.savetxt(path, rows, delimiter=",", header="Time [s],Displacement [m]", comments="", fmt="%.17g")
    words = ("fit", path, "--rig", RIG, "--out", files["json"], "--plot", files["png"])
    called = fricjax(*words)
    assert called.code == 3
    assert "Error: The fit is not valid: does not describe: repair of its slips would (" in called.err
    assert "status:      does not describe: repair of its slips would (" in called.out
    found = fj.load_fit(files["json"])
    assert not found.described and found.status.startswith("does not describe")
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    as_json = fricjax(*words, "--json", "--force")
    report = json.loads(as_json.out)
    assert (as_json.code, report["kind"], report["exit_code"], report["described"]) == (3, "fit", 3, False)
    assert found.status.endswith("; fit with repair='slips'.")
    assert report["error"] == report["status"] == found.status.replace("repair='slips'", "--repair slips")
    assert report["files"] == {"fit": str(files["json"]), "picture": str(files["png"])}
    assert report["values"]["mu"] == found.values["mu"]


def test_a_fit_at_a_bound_ends_with_three(fricjax):
    called = fricjax("fit", RUN, "--rig", RIG, "--bounds", "damping=0.2:0.3", "--json")
    report = json.loads(called.out)
    assert (called.code, report["described"], report["values"]["damping"]) == (3, False, 0.2)


@pytest.mark.slow
def test_a_fit_without_finite_numbers_is_written_without_a_picture(fricjax, tmp_path):
    """An overdamped machine has no half-cycles."""
    words = ("--rig", RIG, "--free", "mu", "--fix", "damping=1e5")
    files = ("--out", tmp_path / "fit.json", "--plot", tmp_path / "fit.png")
    called = fricjax("fit", RUN, *words, *files)
    assert called.code == 3
    assert "Error: The fit is not valid: not finite: the model fails at the start values." in called.err
    assert fj.load_fit(tmp_path / "fit.json").status.startswith("not finite")
    assert [path.name for path in tmp_path.iterdir()] == ["fit.json"]


def test_inspect_prints_and_draws(fricjax, tmp_path):
    called = fricjax("inspect", RUN, "--plot", tmp_path / "run.png")
    assert called.code == 0
    assert "half-cycles:    13" in called.out
    assert (tmp_path / "run.png").stat().st_size > 10_000
    report = json.loads(fricjax("inspect", RUN, "--json").out)
    assert report["n_half_cycles"] == 13
    assert report["noise"] == pytest.approx(5e-9, rel=0.1)


def test_simulate_reaches_the_golden_stop(fricjax, tmp_path):
    machine = ("--mass", "1", "--stiffness", "5000", "--normal-force", "9.81", "--fix", "mu=0.1")
    called = fricjax(
        "simulate", *machine, "--x0", "3 mm", "--out", tmp_path / "run.h5", "--plot", tmp_path / "x.pdf", "--json"
    )
    report = json.loads(called.out)
    assert called.code == 0
    assert report["n_half_cycles"] == 8
    assert report["t_stop"] == pytest.approx(0.355430635053, rel=1e-9)
    assert report["final_displacement"] == pytest.approx(-1.392e-4, rel=1e-9)
    assert fj.read(tmp_path / "run.h5").trace.n == report["samples"] == round(report["duration"] * 5000)
    assert (tmp_path / "x.pdf").stat().st_size > 0


def test_simulate_adds_noise_and_offset(fricjax, tmp_path):
    words = ("simulate", "--rig", RIG, "--fix", "mu=0.02", "--x0", "2e-3", "--duration", "0.2", "--noise", "5e-9")
    called = fricjax(*words, "--seed", "7", "--offset", "1e-5", "--out", tmp_path / "run.npz")
    assert called.code == 0
    assert "still moving at the end" in called.out
    record = fj.read(tmp_path / "run.npz")
    assert record.trace.sigma is not None
    assert float(record.trace.sigma) == 5e-9
    assert record.meta["coefficients"]["mu"] == 0.02
    again = fricjax(*words, "--seed", "7", "--offset", "1e-5", "--save", tmp_path / "again.npz")
    assert again.code == 0
    assert np.array_equal(record.trace.x, fj.read(tmp_path / "again.npz").trace.x)


def test_models_lists_every_law_with_units(fricjax):
    report = json.loads(fricjax("models", "--json").out)
    assert {entry["name"] for entry in report["models"]} >= {"coulomb", "tanh", "stribeck", "lugre", "quadraticdrag"}
    tanh = next(e for e in report["models"] if e["name"] == "tanh")
    assert [(c["name"], c["unit"]) for c in tanh["coefficients"]] == [("mu", ""), ("v_s", "m/s")]
    assert "v_stribeck [m/s]" in fricjax("models").out


def test_doctor_is_content_with_a_sound_installation(fricjax):
    called = fricjax("doctor", "--json")
    report = json.loads(called.out)
    assert called.code == 0, called.out
    assert report["healthy"]
    assert report["cache"]["folder"] == os.environ["JAX_COMPILATION_CACHE_DIR"]
    assert report["cache"]["loaded"] + report["cache"]["compiled"] > 0
    assert ".mat" in report["formats"]
    assert all(check["ok"] for check in report["checks"].values())


def test_doctor_says_what_fails(fricjax, monkeypatch):
    from fricjax.cli import doctor

    def tiny_fit():
        raise RuntimeError("no luck")

    monkeypatch.setattr(doctor, "tiny_fit", tiny_fit)
    called = fricjax("doctor")
    assert called.code == 1
    assert "FAILED: RuntimeError: no luck" in called.out


@pytest.mark.slow
def test_the_example_run_agrees_with_its_metadata():
    from fricjax.instrument import synthetic_run

    record, rig = fj.read(RUN), Rig.from_toml(RIG)
    facts = record.meta["coefficients"]
    machine = rig.oscillator(fj.friction.Coulomb(facts["mu"]))
    parameters = record.meta["parameters"]
    given = ("rate", "duration", "noise", "seed", "offset", "hold", "release_time_constant")
    again = synthetic_run(machine, parameters["x0"], **{name: parameters[name] for name in given})
    assert np.max(np.abs(np.asarray(again.trace.x) - np.asarray(record.trace.x))) < 1e-12
    assert again.meta["coefficients"] == pytest.approx(facts, rel=1e-12)
    assert Path(RUN).stat().st_size < 300_000


def test_doctor_says_which_extras_are_missing_and_how_to_get_them(monkeypatch):
    from fricjax.cli import doctor

    monkeypatch.setattr(doctor, "find_spec", lambda name: None if name == "numpyro" else object())
    assert doctor._extra_text("batch") == "installed"
    assert doctor._extra_text("bayes") == "without numpyro: pip install 'fricjax[bayes]'"
    monkeypatch.setattr(doctor, "_CARD", Path("/dev/null"))
    assert doctor._devices_text(["cpu:0"]) == (
        "cpu:0; there is an NVIDIA card that JAX does not use: pip install 'jax[cuda13]'"
    )
    assert doctor._devices_text(["cuda:0"]) == "cuda:0"


def test_the_extras_of_the_doctor_are_those_of_the_package():
    import re
    import tomllib

    from fricjax.cli import doctor

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]

    def packages(extra):
        names = [re.split(r"[>\[]", requirement)[0] for requirement in extras[extra]]
        others = [name for requirement in extras[extra] for name in re.findall(r"fricjax\[(.*)\]", requirement)]
        parts = [packages(part) for other in others for part in other.split(",")]
        return {name.replace("-", "_") for name in names}.union(*parts) - {"fricjax"}

    # Extras for development are left out, and "formats" contains the single formats.
    inner = {"dev", "docs", "peers", "excel", "tdms", "parquet", "uff", "mdf"}
    assert set(doctor._EXTRAS) == set(extras) - inner
    for extra, modules in doctor._EXTRAS.items():
        # nbclient and nbmake run notebooks in tests, and "dask[distributed]" needs distributed.
        listed = {"distributed" if name == "dask" else name for name in packages(extra)} - {"nbclient", "nbmake"}
        assert set(modules) == listed, extra
