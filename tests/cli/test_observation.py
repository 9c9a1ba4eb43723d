"""Records of gyroscopes and of filmed pendulums on the command line."""

import json

import numpy as np
import pytest

import fricjax as fj

FREQUENCY, RATIO, BAND, LENGTH = 0.8541, 0.00149, 0.003056, 0.42
OMEGA = 2 * np.pi * FREQUENCY
LAW = fj.friction.Coulomb(BAND * OMEGA**2)
PENDULUM = fj.Oscillator(1.0, OMEGA**2, 2 * RATIO * OMEGA, 1.0, LAW, restoring=fj.restoring.Pendulum())
TRUE = {"natural_frequency": FREQUENCY, "damping_ratio": RATIO, "dead_band": BAND}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write records of a gyroscope and of a tracker."""
    place, random = tmp_path_factory.mktemp("readings"), np.random.default_rng(1)
    t = np.arange(2000) / 100
    motion = fj.simulate(PENDULUM, 0.45, t)
    rate = np.asarray(motion.v) + 0.02 + 3e-3 * random.standard_normal(t.size)
    rows = "\n".join(f"{time:.2f},{value:.6f}" for time, value in zip(t, rate, strict=True))
    (place / "gyro.csv").write_text(f"time (s),angular_velocity (rad/s)\n{rows}\n")
    (place / "bare.csv").write_text(f"time,angular_velocity\n{rows}\n")
    theta = np.asarray(motion.x)
    x, y = (LENGTH * part + 5e-4 * random.standard_normal(t.size) for part in (np.sin(theta), -np.cos(theta)))
    rows = "\n".join(f"{a:.2f}\t{b:.7f}\t{c:.7f}" for a, b, c in zip(t, x, y, strict=True))
    (place / "tracker.txt").write_text(f"mass A\t\t\nt\tx\ty\n{rows}\n")
    return place


def check_kinematics(outcome):
    for name, true in TRUE.items():
        found = outcome["kinematics"][name]
        assert abs(found["value"] - true) < 4 * found["std"], name
    assert outcome["kinematics"]["dead_band"]["std"] < 0.02 * BAND


@pytest.mark.parametrize(("file", "options"), [("gyro.csv", ()), ("bare.csv", ("--unit", "rad/s", "--time-unit", "s"))])
def test_a_gyroscope_is_fitted_as_a_velocity(fricjax, folder, file, options):
    called = fricjax("fit", folder / file, *options, "--restoring", "pendulum", "--json")
    outcome = json.loads(called.out)
    assert called.code == 0 and outcome["quantity"] == "rad/s"
    assert abs(outcome["values"]["offset"] - 0.02) < 4 * outcome["std_errors"]["offset"]
    check_kinematics(outcome)


def test_the_drift_of_a_velocity_can_be_bounded(fricjax, folder):
    called = fricjax("fit", folder / "gyro.csv", "--restoring", "pendulum", "--bounds", "drift=-1e-5:1e-5", "--json")
    assert abs(json.loads(called.out)["values"]["drift"]) <= 1e-5


@pytest.mark.parametrize("command", ["inspect", "fit"])
def test_a_velocity_without_a_unit_is_an_error_that_names_the_option(fricjax, folder, command):
    called = fricjax(command, folder / "bare.csv")
    assert called.code == 4 and "names no unit and seems to be a velocity. Give its unit, such as --unit" in called.err


def test_a_filmed_pendulum_is_fitted_with_its_length(fricjax, folder):
    refused = fricjax("fit", folder / "tracker.txt")
    assert refused.code == 4 and "--pendulum-length" in refused.err
    named = ("--pendulum-length", "0.42 m", "--unit", "m", "--time-unit", "s", "--restoring", "pendulum")
    called = fricjax("fit", folder / "tracker.txt", *named, "--json")
    outcome = json.loads(called.out)
    assert called.code == 0 and outcome["quantity"] == "m"
    check_kinematics(outcome)
    assert "rad" in fricjax("fit", folder / "tracker.txt", *named).out


def test_inspect_shows_reading_and_swing(fricjax, folder):
    shown = fricjax("inspect", folder / "gyro.csv").out
    assert "angular velocity in rad/s" in shown and "mrad/s rms" in shown
    outcome = json.loads(fricjax("inspect", folder / "gyro.csv", "--json").out)
    assert (outcome["unit"], outcome["motion"], outcome["observation"]) == ("rad/s", "rad", "velocity")
    assert outcome["amplitude"] == pytest.approx(0.45, rel=0.02)


def test_a_simulated_velocity_is_written_as_one(fricjax, tmp_path):
    options = ("--mass", 0.4, "--stiffness", 400, "--normal-force", 10, "--fix", "mu=0.01,damping=0.05")
    called = fricjax("simulate", "--x0", "5 mm", *options, "--observation", "velocity", "--out", tmp_path / "run.csv")
    assert called.code == 0 and fj.read(tmp_path / "run.csv").quantity == "m/s"
    refused = fricjax("simulate", "--x0", "5 mm", *options, "--observation", "speed")
    assert refused.code == 2 and "There is no kind of observation 'speed'" in refused.err
