"""`fricjax calibrate`: results, rig files and refusals."""

import json
import math

import numpy as np
import pytest

import fricjax as fj
from fricjax.rig import Measured, Rig
from tests.helpers import PROTOTYPE_DAMPING as DAMPING
from tests.helpers import PROTOTYPE_MASS as MASS

STIFFNESS, FREQUENCY, RATIO = 2574.0, 12.6, 0.0027


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Write a receptance with 1 % of noise, in micrometres per newton."""
    f = 10 + np.arange(401) / 80
    omega = 2 * np.pi * f
    generator = np.random.default_rng(0)
    noise = generator.standard_normal(f.size) + 1j * generator.standard_normal(f.size)
    x = 1e6 / (STIFFNESS - MASS * omega**2 + 1j * DAMPING * omega) * (1 + 0.01 * noise / math.sqrt(2))
    path = tmp_path_factory.mktemp("frf") / "frf.csv"
    rows = [f"{a:.4f},{b.real:.6f},{b.imag:.6f}" for a, b in zip(f, x, strict=True)]
    path.write_text("\n".join(["Frequency [Hz],Re [um/N],Im [um/N]", *rows]))
    return path


@pytest.fixture(scope="module")
def decay(tmp_path_factory):
    """Write a ring-down of the prototype without contact."""
    oscillator = fj.Oscillator(MASS, STIFFNESS, DAMPING, 1.0, fj.friction.Coulomb(0.0))
    path = tmp_path_factory.mktemp("decay") / "free.npz"
    fj.write(fj.synthetic_run(oscillator, 2e-3, rate=2e3, duration=10.0, noise=5e-9, seed=2), path)
    return path


def test_frf_prints_and_writes_a_rig(fricjax, table, tmp_path):
    words = ("calibrate", "frf", table, "--normal-force", "9.66 +/- 0.05 N", "--out", tmp_path / "rig.toml")
    called = fricjax(*words)
    assert called.code == 0, called.err
    assert "peak picking" in called.out
    assert f"Rig: {tmp_path / 'rig.toml'}" in called.err
    rig = Rig.from_toml(tmp_path / "rig.toml")
    assert rig.frequency is not None
    assert abs(rig.frequency.value - FREQUENCY) < 4 * rig.frequency.std
    assert abs(rig.mass.value - MASS) < 4 * rig.mass.std
    assert rig.normal_force == Measured(9.66, 0.05)


def test_frf_as_json(fricjax, table):
    called = fricjax("calibrate", "frf", table, "--json", "--duration", "10")
    assert (called.code, called.err) == (0, "")
    report = json.loads(called.out)
    assert report["stiffness"]["value"] == pytest.approx(STIFFNESS, rel=0.01)
    assert report["duration"] == 10
    assert "too short for this damping" in report["warnings"][0]
    assert report["files"] == {}


@pytest.mark.slow
def test_ringdown_prints_and_writes_a_rig(fricjax, decay, tmp_path):
    out = tmp_path / "rig.toml"
    words = ("--normal-force", "1.89", "--mass", "410.68(4) g", "--out", out, "--json")
    called = fricjax("calibrate", "ringdown", decay, *words)
    assert called.code == 0, called.out
    report = json.loads(called.out)
    assert report["frequency"]["value"] == pytest.approx(FREQUENCY, rel=1e-8)
    assert report["damping_ratio"]["value"] == pytest.approx(RATIO, rel=1e-5)
    assert abs(report["quadratic_drag"]["value"]) < 3 * report["quadratic_drag"]["std"]
    assert abs(report["dead_band"]["value"]) < 3 * report["dead_band"]["std"]
    assert report["kept"] == []
    assert [note.split(",")[0] for note in report["notes"]] == [
        "The dead band is not significant",
        "The quadratic drag is not significant",
    ]
    assert report["files"] == {"rig": str(out)}
    rig = Rig.from_toml(out)
    assert rig.mass == Measured(0.41068, 4e-5)
    assert rig.damping_ratio == Measured(**report["damping_ratio"])


def test_a_rig_file_needs_more_numbers_than_a_calibration_gives(fricjax, table, tmp_path):
    for command, missing in (("frf", "--normal-force"), ("ringdown", "--normal-force and --mass")):
        called = fricjax("calibrate", command, table, "--out", tmp_path / "rig.toml")
        assert called.code == 2
        assert called.err.startswith(
            "Error: A rig file needs numbers that this calibration does not give: add " + missing
        )
        assert list(tmp_path.iterdir()) == []


def test_a_table_that_is_none_is_rejected(fricjax, tmp_path):
    (tmp_path / "frf.csv").write_text("1,2\n2,3\n3,4\n")
    called = fricjax("calibrate", "frf", tmp_path / "frf.csv")
    assert called.code == 4
    assert "a receptance needs 3: frequency, real part, imaginary part" in called.err


def test_help_explains_every_option(fricjax):
    for command, options in {"ringdown": ("--mass", "--restoring"), "frf": ("--duration", "--scale-std")}.items():
        text = fricjax("calibrate", command, "--help").out
        for option in (*options, "--normal-force", "--out", "--json", "--quiet"):
            assert option in text, (command, option)
