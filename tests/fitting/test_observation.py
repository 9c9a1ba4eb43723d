"""Fits of velocities, accelerations and filmed pendulums."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.estimation.loss import Squares
from fricjax.fitting.mesh import with_mesh
from fricjax.fitting.tabulate import TabulatedModel, untabulated
from tests.fitting.problem_of import problem_of
from tests.tables import check_rows
from tests.tiers import cases

FREE = ("mu", "damping", "stiffness")
OMEGA, BAND = 2 * np.pi * 5, 5e-4
TRUE = {"mu": 0.02, "damping": 0.1, "stiffness": 0.4 * OMEGA**2}
LOAD = BAND * TRUE["stiffness"] / TRUE["mu"]


def machine(law=None, **options):
    return fj.Oscillator(0.4, TRUE["stiffness"], TRUE["damping"], LOAD, law or fj.friction.Coulomb(0.02), **options)


LINEAR = machine()
PENDULUM = machine(restoring=fj.restoring.Pendulum())
# Noise, offset and drift of each reading; a release from 10 mm, or from 20 mrad of the pendulum.
READINGS = {
    "displacement": ("displacement", LINEAR, {"noise": 1e-5, "offset": 1e-3}),
    "velocity": ("velocity", LINEAR, {"noise": 3e-4, "offset": 0.02, "drift": 1e-3}),
    "acceleration": ("acceleration", LINEAR, {"noise": 1e-2, "offset": 0.3, "drift": -2e-3}),
    "projection": (fj.Observation("projection", length=0.42), PENDULUM, {"noise": 5e-6, "offset": 0.1}),
}


def record(name, seed=0, duration=1.5):
    kind, oscillator, sensor = READINGS[name]
    return fj.synthetic_run(oscillator, 10e-3, rate=500.0, duration=duration, seed=seed, observation=kind, **sensor)


@pytest.fixture(scope="module")
def fits():
    return {name: fj.fit(record(name), READINGS[name][1], FREE) for name in READINGS}


def deviations(fit):
    return np.array([(fit.values[name] - TRUE[name]) / fit.std_errors[name] for name in FREE])


@pytest.mark.parametrize("name", READINGS)
def test_a_fit_recovers_the_machine(fits, name):
    fit = fits[name]
    assert fit.converged and fit.half_cycles == (8,)
    assert np.max(np.abs(deviations(fit))) < 4
    assert fit.chi2_reduced == pytest.approx(1.0, abs=0.2) and fit.numerical_shift < 0.01


def test_a_limit_of_the_dead_band_has_the_unit_of_the_motion():
    free = machine(fj.friction.Coulomb(0.0))
    gyro = fj.synthetic_run(
        free, 10e-3, rate=500.0, duration=1.5, observation=fj.Observation("velocity", "rad"), noise=3e-4, seed=1
    )
    # Seed 1 has its optimum at friction of zero.
    status = fj.fit(gyro, machine(), FREE).status
    assert re.match(r"no dry friction: dead band < [0-9.]+ [a-z]?rad \(95 %\)", status), status


def test_a_velocity_has_bias_and_drift_as_nuisances(fits):
    fit = fits["velocity"]
    assert fit.names[3:] == ("t_release", "x0", "offset", "drift")
    bias = fit.values["offset"] - fit.origins[0] * fit.values["drift"]
    for found, true, name in ((bias, 0.02, "offset"), (fit.values["drift"], 1e-3, "drift")):
        assert abs(found - true) < 4 * fit.std_errors[name]
    assert "drift" not in fits["displacement"].names and "drift" not in fits["projection"].names


UNITS = {
    "displacement": ("m", "m", None, "N/m"),
    "velocity": ("m/s", "m/s", "m/s^2", "N/m"),
    "acceleration": ("m/s^2", "m/s^2", "m/s^3", "N/m"),
    "projection": ("m", "m", None, "N m/rad"),
}


def test_units_are_those_of_reading_and_motion(fits):
    def check(name, quantity, offset, drift, stiffness):
        fit = fits[name]
        assert (fit.quantity, fit.units["offset"], fit.units.get("drift")) == (quantity, offset, drift)
        assert fit.units["stiffness"] == stiffness and fit.to_dict()["quantity"] == quantity
        motion = "rad" if name == "projection" else "m"
        assert fit.units["x0"] == motion and f" {'urad' if motion == 'rad' else 'um'}" in fit.summary()

    check_rows(check, {name: (name, *row) for name, row in UNITS.items()})


def test_displacement_and_velocity_of_one_motion_agree(fits):
    """The noise of both sensors is independent, so variances add up."""
    first, second = (fits[name] for name in ("displacement", "velocity"))
    for name in FREE:
        std = np.hypot(first.std_errors[name], second.std_errors[name])
        assert abs(first.values[name] - second.values[name]) < 4 * std


@pytest.mark.slow
@pytest.mark.parametrize("name", READINGS)
def test_standard_errors_are_the_scatter_of_many_records(name):
    kind = READINGS[name][1]
    z = np.array([deviations(fj.fit(record(name, seed), kind, FREE)) for seed in range(40)])
    # The rms of 40 standard normal numbers lies between 0.7 and 1.34 with a probability of 0.995.
    rms = np.sqrt(np.mean(z**2, axis=0))
    assert np.all((rms > 0.65) & (rms < 1.4)), rms


def test_residuals_and_prediction_are_readings(fits):
    def check(name):
        fit, data = fits[name], record(name)
        used = np.isfinite(fit.residuals)
        assert np.std(fit.residuals[used]) == pytest.approx(READINGS[name][2]["noise"], rel=0.1)
        predicted = fit.predict(data.t[used])
        # An acceleration jumps at the reversals, and a sample there may lie on the other side.
        off = np.abs(data.x[used] - predicted - fit.residuals[used]) / fit.sigma
        assert np.quantile(off, 0.97) < 0.05 and (name == "acceleration" or off.max() < 0.05)

    check_rows(check, READINGS.keys())


def test_an_acceleration_is_fitted_without_samples_at_its_jumps(fits):
    fit, data = fits["acceleration"], record("acceleration")
    dropped = ~np.isfinite(fit.residuals) & (data.t > fit.values["t_release"] + 0.01)
    reversals = fit.values["t_release"] + np.pi / OMEGA * np.arange(9)
    near = np.min(np.abs(data.t[dropped][:, None] - reversals), axis=1)
    assert 8 <= dropped.sum() <= 0.1 * len(data) and np.all(near < 0.05)


def test_stored_fits_keep_the_observation(tmp_path, fits):
    def check(name):
        back = fj.load_fit(fits[name].save(tmp_path / f"{name}.json"))
        assert back.observation == fits[name].observation
        times = record(name).t[::10]
        np.testing.assert_allclose(back.predict(times), fits[name].predict(times), rtol=1e-12)

    check_rows(check, READINGS.keys())


def test_readings_of_different_units_are_not_joined():
    with pytest.raises(UsageError, match="One fit cannot join records in m with records in m/s"):
        fj.fit([record("displacement"), record("velocity")], LINEAR, FREE)


def test_a_joint_fit_has_a_bias_for_each_run():
    joint = fj.fit([record("velocity", seed, duration=1.2) for seed in (1, 2)], LINEAR, FREE)
    assert joint.converged and {"offset[0]", "drift[1]"} < set(joint.names)
    assert np.max(np.abs(deviations(joint))) < 4


def test_a_batch_fits_velocities_as_fits_do():
    runs = [record("velocity", seed) for seed in (3, 4, 5)]
    batch = fj.fit_batch(runs, LINEAR, FREE)
    assert batch.converged.all() and batch.units["drift"] == "m/s^2"
    for i, run in enumerate(runs):
        alone = fj.fit(run, LINEAR, FREE)
        for name in FREE:
            assert batch.values[name][i] == pytest.approx(alone.values[name], abs=0.02 * alone.std_errors[name])


STARTS = ({"start": "release"}, {"start": 0.33}, {"nuisance": ["t_release", "x0", "offset"]}, {"noise": "floor"})


def test_other_settings_fit_velocities_too():
    def check(**settings):
        fit = fj.fit(record("velocity"), LINEAR, FREE, **settings)
        assert fit.converged, fit.status
        assert ("drift" in fit.names) == ("nuisance" not in settings)
        # A drift of 1e-3 over 1.5 s that is not fitted is below the noise of a sample but moves the damping.
        assert np.max(np.abs(deviations(fit))) < (4 if "nuisance" not in settings else 12)

    check_rows(lambda settings: check(**settings), {str(each): (each,) for each in STARTS})


def traced(residual):
    """Return the compiled residual and its derivatives."""
    residual = jax.tree.map(jnp.asarray, residual)
    return jax.jit(lambda y: residual(y)), jax.jit(jax.jacfwd(lambda y: residual(y)))


ENGINES = {
    "exact": ("exact", fj.friction.Coulomb(0.02)),
    "hybrid": ("hybrid", fj.friction.Tanh(0.02, 1e-2)),
    "smooth": ("smooth", fj.friction.Dahl(0.02, sigma0=1e4)),
}


@pytest.mark.parametrize("engine", cases(ENGINES, core=("exact",)))
@pytest.mark.parametrize("kind", ["velocity", "acceleration"])
def test_derivatives_of_an_engine_are_those_of_finite_differences(engine, kind):
    name, law = ENGINES[engine]
    noise = {"velocity": 3e-4, "acceleration": 1e-2}[kind]
    run = fj.synthetic_run(machine(law), 10e-3, rate=500.0, duration=0.7, observation=kind, noise=noise)
    residual = untabulated(problem_of(run, machine(law), FREE, engine=name).condensed)
    y = np.zeros(residual.n_parameters)
    residual = with_mesh(residual, y)
    value, slopes = traced(residual)
    slopes = np.asarray(slopes(jnp.asarray(y)))
    for place in range(y.size):
        step = np.zeros(y.size)
        step[place] = 1e-6
        difference = (np.asarray(value(y + step)) - np.asarray(value(y - step))) / 2e-6
        off = np.abs(difference - slopes[:, place]) / np.max(np.abs(slopes[:, place]))
        # Samples that pass a reversal within the step differ, and those at which bristles turn.
        assert np.quantile(off, 0.9) < 1e-4, residual.space.places(0)


@pytest.mark.parametrize("name", READINGS)
def test_tables_and_engine_agree(name):
    """The model on the host and the traced one are independent implementations."""
    problem = problem_of(record(name, duration=0.75), READINGS[name][1], FREE)
    y = np.zeros(problem.condensed.n_parameters)
    tabulated = TabulatedModel(problem.condensed, y).evaluate(
        y, [run.weight for run in problem.condensed.runs], Squares()
    )
    residual = with_mesh(untabulated(problem.condensed), y)
    value, slopes = (np.asarray(function(jnp.asarray(y))) for function in traced(residual))
    normal = slopes.T @ slopes
    scale = np.sqrt(np.outer(np.diag(normal), np.diag(normal)))
    off = np.abs(tabulated.residual - value)
    assert np.sort(off)[-8] < 1e-2 and np.max(np.abs(tabulated.normal - normal) / scale) < 1e-3


# Powers of the scales of reading and time in the parameters, for known mass and load. A displacement is the integral of
# a velocity, and that of an acceleration twice; k = m omega^2, c = 2 zeta m omega, and mu = k x_d/N.
POWERS = {
    "velocity": {"dead_band": (1, 1), "mu": (1, -1), "stiffness": (0, -2), "damping": (0, -1)},
    "acceleration": {"dead_band": (1, 2), "mu": (1, 0), "stiffness": (0, -2), "damping": (0, -1)},
}


@pytest.mark.parametrize("kind", POWERS)
def test_scales_of_reading_and_time_act_by_their_powers(kind):
    scale, clock = 1e-4, 2e-4
    rig = fj.Rig(
        mass=0.4, stiffness=TRUE["stiffness"], damping=TRUE["damping"], normal_force=LOAD,
        displacement_scale=fj.Measured(1.0, scale), time_scale=fj.Measured(1.0, clock),
    )  # fmt: skip
    fit = fj.fit(record(kind), LINEAR, FREE, rig=rig)
    for name, powers in POWERS[kind].items():
        value = fit.values[name] if name in fit.values else fit.kinematics[name].value
        parts = fit.contributions[name]
        found = parts["displacement_scale"] / value / scale, parts["time_scale"] / value / clock
        # The noise turns the estimates a little: by some standard errors in units of the value.
        assert found == pytest.approx(powers, abs=5e-3), name
