"""Conversion of fits, records and parameters to and from other packages."""

import sys

import jax
import lmfit
import numpy as np
import pytest
import uncertainties
import xarray

import fricjax as fj
from fricjax.errors import UsageError

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]
RIG = fj.Rig(mass=fj.Measured(0.4, 4e-4), stiffness=2500.0, normal_force=fj.Measured(10.0, 0.02), damping=0.2)


@pytest.fixture(scope="module")
def runs():
    return [fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in (0, 1)]


@pytest.fixture(scope="module")
def fit(runs):
    return fj.fit(runs[0], MACHINE, FREE, rig=RIG)


def test_numbers_of_uncertainties_have_the_covariance_of_the_fit(fit):
    numbers = fit.to_uncertainties()
    covariance = uncertainties.covariance_matrix([numbers[name] for name in fit.names])
    np.testing.assert_allclose(covariance, fit.combined_covariance, rtol=1e-6, atol=1e-30)
    # Dead band mu N/k with an exact load, against derivatives by hand.
    band = numbers["mu"] * 10.0 / numbers["stiffness"]
    i, j = fit.names.index("mu"), fit.names.index("stiffness")
    mu, k, c = fit.values["mu"], fit.values["stiffness"], fit.combined_covariance
    slope = np.array([10 / k, -mu * 10 / k**2])
    assert band.s == pytest.approx(np.sqrt(slope @ c[np.ix_([i, j], [i, j])] @ slope), rel=1e-6)


def test_a_table_holds_numbers_and_not_their_texts(fit):
    table = fit.to_dataframe()
    assert table.loc["mu", "value"] == fit.values["mu"] and table.loc["mu", "combined_std"] > table.loc["mu", "std"] > 0
    assert table.loc["damping", "unit"] == "N s/m" and table.loc["natural_frequency", "remarks"] == "kinematics"
    assert table.loc["mu", "low"] < fit.values["mu"] < table.loc["mu", "high"]


def test_a_data_set_survives_netcdf(fit, tmp_path):
    fit.to_xarray().to_netcdf(tmp_path / "fit.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "fit.nc", engine="h5netcdf") as read:
        assert read["value"].sel(parameter="mu").item() == fit.values["mu"]
        np.testing.assert_array_equal(read["covariance"], fit.covariance)
        np.testing.assert_allclose((read["model"] + read["residual"])[400:], read["x"][400:], atol=1e-18)
        assert read["x"].attrs["units"] == "m" and read["t"].attrs["units"] == "s"
        assert read.attrs["status"] == "described" and read.attrs["converged"] == 1


@pytest.mark.slow
def test_runs_of_a_joint_fit_have_an_axis_each(runs):
    joint = fj.fit(runs, MACHINE, FREE).to_xarray()
    assert joint["x_0"].dims == ("t_0",) and joint["residual_1"].dims == ("t_1",)
    assert "x0[1]" in joint["parameter"]


def test_a_batch_as_a_data_set(runs):
    batch = fj.fit_batch(runs, MACHINE, FREE)
    made = batch.to_xarray()
    assert made["value"].sel(run=1, parameter="mu").item() == batch.values["mu"][1]
    assert made["kinematics"].sel(run=0, quantity="dead_band").item() == batch.kinematics["dead_band"][0]
    assert made["covariance"].dims == ("run", "parameter", "parameter_2")


def test_records_go_out_and_come_back(runs):
    for given in (runs[0].to_xarray(), runs[0].to_xarray()["x"], runs[0].to_dataframe()):
        back = fj.read(given)
        np.testing.assert_array_equal(back.x, runs[0].x)
        np.testing.assert_allclose(back.t, runs[0].t, rtol=1e-15)
        assert back.quantity == "m"


def test_motions_go_out():
    one = fj.simulate(MACHINE, 2e-3, np.linspace(0, 0.6, 12)).to_xarray()
    assert one["x"].dims == ("t",) and one["v"].attrs["units"] == "m/s" and np.isfinite(one["t_stop"].item())
    many = jax.vmap(lambda x0: fj.simulate(MACHINE, x0, np.linspace(0, 0.6, 12)))(np.array([1e-3, 2e-3])).to_xarray()
    assert many["x"].dims == ("motion_0", "sample") and many["t_stop"].shape == (2,)


def test_parameters_of_lmfit_say_what_is_free_and_where_it_starts(runs, fit):
    asked = lmfit.Parameters()
    asked.add("mu", 0.04, min=0.0, max=1.0)
    asked.add("stiffness", 2510.0)
    asked.add("damping", 0.2, vary=False)
    fixed = fj.fit(runs[0], MACHINE, asked)
    assert "damping" not in fixed.names and float(fixed.oscillator.damping) == 0.2
    assert fixed.problem is not None
    assert fixed.problem.parameters[0].upper == 1.0 and fixed.problem.parameters[0].start == 0.04
    assert fixed.values["mu"] == pytest.approx(fit.values["mu"], abs=5 * fit.std_errors["mu"] + 1e-7)
    other = fj.fit(runs[0], MACHINE, asked, guess={"mu": 0.06})
    assert other.problem is not None
    assert other.problem.parameters[0].start == 0.06
    assert fj.fit_batch(runs, MACHINE, asked).names == fixed.names


def test_a_fit_as_parameters_goes_round(runs, fit):
    parameters = fit.to_lmfit()
    assert parameters["mu"].stderr == fit.std_errors["mu"]
    i, j = fit.names.index("mu"), fit.names.index("damping")
    assert parameters["mu"].correl["damping"] == pytest.approx(fit.correlation[i, j])
    assert not parameters["mass"].vary and parameters["mass"].value == 0.4
    again = fj.fit(runs[0], MACHINE, parameters, rig=RIG)
    # Parameters of lmfit have bounds, and a plain fit has none.
    assert (fit.engine, again.engine) == ("exact", "tables")
    for name in fit.names:
        assert again.values[name] == pytest.approx(fit.values[name], abs=1e-2 * fit.std_errors[name])


@pytest.mark.parametrize(
    ("name", "settings", "sentence"),
    [
        ("muh", {"value": 0.1}, "no coefficient 'muh'"),
        ("x0", {"value": 1e-3, "vary": False}, "x0 belongs to the run and cannot be fixed"),
        ("mu", {"expr": "2*damping"}, "mu follows the expression '2*damping': write it as tie="),
    ],
)
def test_parameters_that_cannot_be_meant(runs, name, settings, sentence):
    asked = lmfit.Parameters()
    asked.add("damping", 0.2)
    asked.add(name, **settings)
    with pytest.raises(UsageError, match=sentence.replace("*", r"\*").replace("(", r"\(")):
        fj.fit(runs[0], MACHINE, asked)


@pytest.mark.parametrize("method", ["xarray", "uncertainties", "lmfit"])
def test_a_missing_package_is_one_sentence(fit, monkeypatch, method):
    monkeypatch.setitem(sys.modules, method, None)
    with pytest.raises(UsageError, match=rf"needs? the package {method}: pip install 'fricjax\[interchange\]'\."):
        getattr(fit, f"to_{method}")()
