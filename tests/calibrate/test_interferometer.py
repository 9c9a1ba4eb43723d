"""Length of an interferometer count by hand; its uncertainty by Monte Carlo."""

import json
from typing import Any

import numpy as np
import pytest

import fricjax as fj
from fricjax.cli.main import run
from fricjax.errors import UsageError
from fricjax.instrument import refractive_index

INPUTS: dict[str, Any] = {
    "temperature": "20.1(1)",
    "pressure": "1013.2(3) hPa",
    "humidity": "45(5) %",
    "co2": "450(50) ppm",
}


def test_a_fringe_is_half_the_wavelength_in_air_for_each_pass():
    index = refractive_index()
    for passes in (1, 2, 4):
        scale = fj.calibrate_interferometer(passes=passes, counts=512)
        assert scale.fringe.value == pytest.approx(632.9908e-9 / index / 2 / passes, rel=1e-12)
        assert scale.count.value == pytest.approx(scale.fringe.value / 512, rel=1e-12)


def test_units_are_taken_as_they_are_written():
    written = fj.calibrate_interferometer(
        "0.6329908 um", temperature="293.25 K", pressure="1.0132 bar", humidity="45 %"
    )
    plain = fj.calibrate_interferometer(632.9908e-9, temperature=20.1, pressure=101320.0, humidity=0.45)
    assert written.fringe.value == pytest.approx(plain.fringe.value, rel=1e-12)


def test_the_uncertainty_is_that_of_monte_carlo():
    scale = fj.calibrate_interferometer("632.9908(6) nm", **INPUTS)
    chance, n = np.random.default_rng(1), 4000
    drawn = {
        "temperature": chance.normal(20.1, 0.1, n),
        "pressure": chance.normal(101320, 30, n),
        "humidity": chance.normal(0.45, 0.05, n),
        "co2": chance.normal(450e-6, 50e-6, n),
    }
    light, error = chance.normal(632.9908e-9, 6e-13, n), chance.normal(0, 2e-8, n)
    fringes = [
        light[i] / 2 / (refractive_index(light[i], **{name: each[i] for name, each in drawn.items()}) + error[i])
        for i in range(n)
    ]
    assert scale.fringe.std == pytest.approx(np.std(fringes), rel=0.05)
    parts = np.array(list(scale.contributions.values()))
    assert np.linalg.norm(parts) == pytest.approx(scale.count.relative, rel=1e-6)
    assert scale.displacement_scale == fj.Measured(1.0, scale.count.relative)
    assert not scale.report().warnings


def test_counts_become_metres_and_the_rig_their_uncertainty(tmp_path):
    scale = fj.calibrate_interferometer("632.9908(6) nm", passes=2, counts=512, **INPUTS)
    path = tmp_path / "run.csv"
    path.write_text("t [s],x [counts]\n0,1000\n1,2000\n2,-500\n3,7\n")
    record = fj.read(path, unit=scale.unit)
    assert record.x == pytest.approx(scale.count.value * np.array([1000, 2000, -500, 7]), rel=1e-8)
    rig = fj.Rig(mass=0.41, stiffness=2574.0, normal_force=9.66, displacement_scale=scale.displacement_scale)
    assert rig.displacement_scale is not None and rig.displacement_scale.std == scale.count.relative


def test_what_is_taken_as_exact_is_said():
    [warning] = fj.calibrate_interferometer(pressure="1013.2(3) hPa").report().warnings
    assert warning.startswith("wavelength, temperature, humidity and co2 are taken as exact")


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"temperature": "20 m"}, "The unit 'm' does not fit temperature; write it as \"20.1"),
        ({"pressure": "high"}, "pressure = 'high' is no quantity; write it as \"1013.2"),
        ({"passes": 0}, "passes must be a whole number such as 1"),
        ({"counts": 0}, "counts must be a positive number"),
        ({"humidity": "45"}, "humidity must lie between 0 and 1"),
    ],
)
def test_what_is_no_input(inputs, message):
    with pytest.raises(UsageError, match=message):
        fj.calibrate_interferometer(**inputs)


def test_the_command_says_what_to_write(capsys):
    assert run(["calibrate", "interferometer", "--passes", "2", "--pressure", "1013.2(3) hPa"]) == 0
    text = capsys.readouterr().out
    assert 'unit="158.20477 nm/count"' in text and 'displacement_scale = "1 +/- 8.3e-08"' in text
    assert run(["calibrate", "interferometer", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["fringe"]["value"] == pytest.approx(316.4095e-9, rel=1e-6)
