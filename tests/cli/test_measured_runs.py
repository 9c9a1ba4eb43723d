"""Commands on measured runs of pendulums with encoders."""

import json

import pytest


@pytest.mark.slow
def test_small_swing_of_a_pendulum(fricjax, measured_data):
    path = measured_data("multiarm-pendulum/SingleDataFreeSwing_1_Dt_0_0001.mat")
    called = fricjax("fit", path, "--column", "Theta1", "--unit", "rad", "--restoring", "pendulum", "--json")
    report = json.loads(called.out)
    assert called.code == 3
    assert report["status"].startswith("does not describe: ")
    assert report["residual_rms"] <= 6.0e-4
    assert report["kinematics"]["friction_deceleration"]["value"] == pytest.approx(0.152, rel=0.05)
    assert report["std_errors"]["mu"] > 10 * report["white_std_errors"]["mu"]


@pytest.mark.slow
def test_degrees_without_a_time_column(fricjax, measured_data):
    path = measured_data("rotary-pendulum/data03.txt")
    called = fricjax("fit", path, "--rate", "1000", "--unit", "deg")
    assert called.code == 3
    assert "status:      described" not in called.out
    assert "restoring force was taken as linear: see --restoring pendulum" in called.out
    assert "it has a correlation time of" in called.out


def test_a_held_start_is_found(fricjax, measured_data):
    path = measured_data("rotary-pendulum/data03.txt")
    report = json.loads(fricjax("inspect", path, "--rate", "1000", "--unit", "deg", "--json").out)
    assert report["unit"] == "rad"
    assert report["release"] > 0.0
    assert report["rest"] is None
