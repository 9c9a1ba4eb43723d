"""Observations: units, the derived displacement, its segmentation, and files."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.data.observation import DISPLACEMENT, ORDERS, observation_of
from fricjax.errors import DataError, UsageError
from tests.tables import check_rows

OMEGA, RATIO, BAND = 2 * np.pi * 0.85, 2e-3, 3e-3
LINEAR = fj.Oscillator(1.0, OMEGA**2, 2 * RATIO * OMEGA, 1.0, fj.friction.Coulomb(BAND * OMEGA**2))
PENDULUM = fj.Oscillator(1.0, OMEGA**2, 2 * RATIO * OMEGA, 1.0, LINEAR.friction, restoring=fj.restoring.Pendulum())
# Noise, bias and drift of each sensor, in the unit of its reading.
SENSORS = {
    "gyroscope": ("velocity", PENDULUM, {"noise": 3e-3, "offset": 0.05, "drift": 1e-3}),
    "vibrometer": ("velocity", LINEAR, {"noise": 1e-3, "offset": -0.5, "drift": 0.0}),
    "accelerometer": ("acceleration", LINEAR, {"noise": 1e-2, "offset": 0.3, "drift": -2e-3}),
    "camera": (fj.Observation("projection", length=0.42), PENDULUM, {"noise": 1e-3, "offset": 0.6}),
}


def run(kind, machine, seed=0, duration=60.0, **sensor):
    return fj.synthetic_run(machine, 0.4, rate=100.0, duration=duration, seed=seed, observation=kind, **sensor)


def test_the_unit_is_that_of_the_derivative():
    units = {kind: [fj.Observation(kind, motion).unit for motion in ("m", "rad")] for kind in ORDERS}
    assert units == {
        "displacement": ["m", "rad"],
        "velocity": ["m/s", "rad/s"],
        "acceleration": ["m/s^2", "rad/s^2"],
        "projection": ["m", "m"],
    }
    assert fj.Observation("velocity", "rad").drift_unit == "rad/s^2" and DISPLACEMENT.drift_unit == "m/s"


def test_metadata_restore_the_observation():
    for observation in (DISPLACEMENT, fj.Observation("acceleration", "rad"), fj.Observation("projection", length=0.4)):
        assert observation_of({"source": "run.csv", **observation.meta}) == observation
    with pytest.raises(DataError, match=r"must be the unit of a displacement, .*'kg'"):
        observation_of({"quantity": "kg"})


def test_impossible_observations_are_refused():
    def check(message, *arguments, **named):
        with pytest.raises(UsageError, match=message):
            fj.Observation(*arguments, **named)

    check("There is no kind of observation 'speed'", "speed")
    check("There is no motion 'deg'", "velocity", "deg")
    check("length must be the positive length", "projection", length=-1.0)
    check("angle must be a finite number", "projection", length=1.0, angle=np.inf)
    check("length must be one number", "projection", length="long")


def test_the_slope_is_the_derivative_of_the_reading():
    camera = fj.Observation("projection", length=0.42, angle=0.1)
    at, step = np.array([-0.8, 0.0, 0.5]), 1e-6
    slope = (camera.read(at + step) - camera.read(at - step)) / (2 * step)
    np.testing.assert_allclose(camera.slope(at), slope, rtol=1e-9)
    assert camera.gain(3.0) == pytest.approx(0.42 * np.cos(0.1))
    assert fj.Observation("acceleration").gain(3.0) == 9.0


def test_half_cycles_are_those_of_the_displacement():
    """The same motion without noise, read as a displacement, is the reference."""

    def check(kind, machine, sensor):
        found = run(kind, machine, **sensor).segmentation
        true = run("displacement", machine, noise=1e-6).segmentation
        assert found.n_half_cycles == true.n_half_cycles
        assert found.rest == pytest.approx(true.rest, abs=0.5 * true.half_period)
        large = slice(0, 30)
        np.testing.assert_allclose(found.turning_times[large], true.turning_times[large], atol=0.02 * true.half_period)
        swing = np.abs(np.diff(true.turning_points))[large]
        np.testing.assert_allclose(np.abs(np.diff(found.turning_points))[large], swing, rtol=0.03)

    check_rows(check, SENSORS)


def test_the_noise_is_that_of_the_reading():
    def check(kind, machine, sensor):
        segmentation = run(kind, machine, **sensor).segmentation
        assert segmentation.gain * segmentation.noise == pytest.approx(sensor["noise"], rel=0.1)
        assert segmentation.gain * segmentation.white_noise == pytest.approx(sensor["noise"], rel=0.1)

    check_rows(check, SENSORS)


def test_the_displacement_is_close_enough_to_start_from():
    """The displacement is right to a tenth of the amplitude."""

    def check(kind, machine, sensor):
        record, true = run(kind, machine, **sensor), run("displacement", machine, noise=0.0)
        moved = record.displacement - np.median(record.displacement)
        assert np.max(np.abs(moved - (true.x - np.median(true.x)))) < 0.04

    check_rows(check, SENSORS)


def test_masked_samples_have_no_effect():
    record = run(*SENSORS["gyroscope"][:2], **SENSORS["gyroscope"][2])
    mask = np.random.default_rng(0).random(len(record)) > 0.1
    bad = fj.Record(fj.Trace(record.t, np.where(mask, record.x, 1e3), mask=mask), record.meta)
    assert bad.segmentation.n_half_cycles == record.segmentation.n_half_cycles
    assert bad.segmentation.noise == pytest.approx(record.segmentation.noise, rel=0.1)


def test_a_gap_is_bridged_by_the_oscillation():
    """Across half a period the trapezoidal rule would fail."""
    record = run(*SENSORS["gyroscope"][:2], **SENSORS["gyroscope"][2])
    true = run("displacement", PENDULUM, noise=0.0).x
    kept = (record.t < 5.0) | (record.t > 5.6)
    moved = fj.Record(fj.Trace(record.t, record.x, mask=kept), record.meta).displacement[kept]
    off = moved - true[kept]
    assert np.max(np.abs(off - np.median(off))) < 0.04


def test_refusals_speak_of_the_reading():
    still = fj.Record(fj.Trace(x=np.full(500, 0.7), rate=100.0), {"source": "gyro.csv", "quantity": "rad/s"})
    with pytest.raises(DataError, match=r"gyro\.csv: x is constant \(exactly, about 0\.7\)"):
        _ = still.segmentation


@pytest.mark.parametrize("suffix", ["csv", "npz", "h5"])
def test_files_keep_the_observation(tmp_path, suffix):
    def check(kind, machine, sensor):
        record = run(kind, machine, duration=10.0, **sensor)
        back = fj.read(fj.write(record, tmp_path / f"{record.observation.kind}.{suffix}", overwrite=True))
        assert back.observation == record.observation and np.array_equal(back.x, record.x)

    check_rows(check, SENSORS)


def test_a_damaged_observation_is_refused(tmp_path):
    record = run(*SENSORS["camera"][:2], duration=10.0, **SENSORS["camera"][2])
    path = fj.write(record, tmp_path / "run.csv")
    path.write_text(path.read_text().replace('"length": 0.42', '"length": -1'))
    with pytest.raises(DataError, match=r"run\.csv claims to be a fricjax record, but it is damaged: length must be"):
        fj.read(path)


def test_a_column_in_the_unit_of_a_velocity_is_one(tmp_path):
    record = run("velocity", PENDULUM, duration=10.0, noise=1e-3)
    path = tmp_path / "gyro.csv"
    rows = (f"{t:.3f},{np.rad2deg(v):.6f}" for t, v in zip(record.t, record.x, strict=True))
    path.write_text("\n".join(["time (s),gyro z (deg/s)", *rows]) + "\n")
    found = fj.read(path)
    assert (found.quantity, found.observation.kind) == ("rad/s", "velocity")
    np.testing.assert_allclose(found.x, record.x, atol=1e-8)
    table = found.to_dataframe()
    assert fj.read(table).quantity == "rad/s"
    assert fj.data.convert_unit(fj.Record(found.t, found.x), "deg/s").x[5] == pytest.approx(np.deg2rad(found.x[5]))


def test_a_filmed_pendulum_is_read_with_its_length(tmp_path):
    x = 0.42 * np.sin(0.4 * np.cos(np.arange(200) / 10))
    table = {"t [s]": np.arange(200) / 30, "x [m]": x}
    for length in (0.42, "0.42 m", "42 cm"):
        assert fj.read(table, pendulum_length=length).observation == fj.Observation("projection", length=0.42)
    for options, message in (
        ({"pendulum_length": -1}, "pendulum_length must be positive"),
        ({"pendulum_length": "long"}, "'long' is not a known unit, but the length of the pendulum has it"),
        ({"pendulum_length": 0.42, "column": "v"}, r"pendulum_length= needs a position in m"),
    ):
        with pytest.raises((DataError, UsageError), match=message):
            fj.read({**table, "v [m/s]": x}, **options)


def test_inspect_reports_reading_and_motion():
    inspection = fj.data.inspect(run(*SENSORS["gyroscope"][:2], **SENSORS["gyroscope"][2]))
    assert (inspection.unit, inspection.motion, inspection.observation) == ("rad/s", "rad", "velocity")
    assert inspection.noise == pytest.approx(3e-3, rel=0.1) and inspection.amplitude == pytest.approx(0.4, rel=0.02)
    text = inspection.summary()
    assert "reading:        angular velocity in rad/s" in text and "mrad/s rms" in text


def test_the_figure_is_labelled_with_the_reading():
    record = run(*SENSORS["accelerometer"][:2], **SENSORS["accelerometer"][2])
    assert record.plot().axes[0].get_ylabel() == "Acceleration [m/s^2]"
    assert "Acceleration" in record.thumbnails()[0]


def test_routes_that_need_a_displacement_refuse_other_readings():
    record = run(*SENSORS["vibrometer"][:2], **SENSORS["vibrometer"][2])
    rig = fj.Rig(mass=1.0, stiffness=OMEGA**2, damping=0.0, normal_force=1.0)

    def check(route):
        with pytest.raises(DataError, match=r"is a velocity in m/s, and .* needs a displacement or an angle"):
            route(record)

    routes = {"pairs": fj.pairs_of, "force map": lambda run: fj.friction_force_map(run, rig)}
    routes["floor"] = lambda run: fj.fit_on_moving_floor(run, np.zeros(len(run)), LINEAR, ["mu"])
    check_rows(check, {name: (route,) for name, route in routes.items()})
