"""Reports and pictures of batches, machines, motions, records and inspections."""

import jax
import numpy as np
import pytest

import fricjax as fj
from fricjax.calibrate.receptance import receptance
from fricjax.show import Reported

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]


@pytest.fixture(scope="module")
def runs():
    made = [fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in range(23)]
    # One that cannot be fitted: the mass never moves.
    return [*made, fj.Record(made[0].t, 1e-9 * np.random.default_rng(0).standard_normal(made[0].t.size))]


@pytest.fixture(scope="module")
def batch(runs):
    return fj.fit_batch(runs, MACHINE, FREE)


def test_a_batch_shows_its_first_runs_their_mean_and_how_the_fits_ended(batch):
    report = batch.report()
    first, pooled = report.tables
    assert len(first.rows) == 20 and first.columns[1:3] == ["mu", "damping [N s/m]"]
    assert first.rows[0][1] == fj.show.uncertain(batch.values["mu"][0], batch.combined_std_errors["mu"][0])
    assert pooled.rows[0][:2] == [
        "mu",
        fj.show.uncertain(batch.population("mu").mean, batch.population("mu").combined_std),
    ]
    assert dict(report.facts)["runs"].startswith("24: 23 described, 1 ")
    assert report.notes == ["4 more runs are in to_dataframe()."]
    assert batch.to_dict()["values"]["mu"][:23] == batch.values["mu"][:23].tolist()
    assert len(batch.to_dataframe()) == 24


def test_a_machine_shows_the_coefficients_of_its_summands():
    law = fj.friction.Stribeck(0.05, mu_s=0.06, v_stribeck=1e-3) + fj.friction.Viscous(0.1)
    machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, law, restoring=fj.restoring.Cubic(2e6))
    rows = {(of, name): (value, unit) for of, name, value, unit in machine.report().tables[0].rows}
    assert rows["stribeck", "mu_s"] == ("0.0600", "")
    assert rows["cubic", "k3"] == ("2.00e+06", "N/m^3")
    assert rows["viscous", "sigma2"] == ("0.100", "N s/m")
    assert ("coulomb", "mu_s") not in rows
    many = jax.vmap(lambda mu: fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(mu)))(np.array([0.1, 0.2]))
    assert "array[2]" in many.summary()
    jax.jit(lambda mass: fj.Oscillator(mass, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.1)).report() and mass)(0.4)


def test_a_motion_shows_where_it_stopped():
    motion = fj.simulate(MACHINE, 2e-3, np.linspace(0, 0.6, 1200))
    facts = dict(motion.report().facts)
    assert facts["half-cycles"] == str(int(motion.n_half_cycles))
    assert facts["stop"] == f"at {float(motion.t_stop):.6g} s"
    np.testing.assert_array_equal(motion.to_dataframe()["x"], motion.x)
    cut = fj.simulate(MACHINE, 2e-3, np.linspace(0, 0.01, 12))
    assert dict(cut.report().facts)["stop"].startswith("at ")
    several = jax.vmap(lambda x0: fj.simulate(MACHINE, x0, np.linspace(0, 0.6, 12)))(np.array([1e-3, 2e-3]))
    assert several.report().facts[0] == ("motions", "[2]")


def test_records_and_inspections_have_the_face_of_results(runs):
    record, inspection = runs[0], fj.data.inspect(runs[0])
    assert dict(record.report().facts)["samples"] == "1200, 1200 used"
    assert [text for name, text in record.report().facts if name == "log"] == [str(step) for step in record.log]
    assert dict(inspection.report().facts)["rate"] == "2000 Hz, regular"
    assert inspection.to_dict()["n_half_cycles"] == inspection.n_half_cycles
    assert inspection.to_dataframe()["samples"].tolist() == [1200]
    for each in (record, inspection, MACHINE):
        assert isinstance(each, Reported)
        assert each.summary() and each._repr_html_().startswith("<table>")


def test_every_result_has_a_picture_for_the_screen_and_for_a_column(runs, batch):
    files = fj.data.example_paths()
    rig = fj.Rig.from_toml(files.rig)
    law = fj.friction.Stribeck(0.05, mu_s=0.06, v_stribeck=1e-3) + fj.friction.Viscous(0.1)
    several = jax.vmap(lambda x0: fj.simulate(MACHINE, x0, np.linspace(0, 0.6, 12)))(np.array([1e-3, 2e-3]))
    force_fit = fj.fit_force_map(fj.friction_force_map(files.run, rig), fj.friction.Coulomb(0.05), ["mu"])
    free = rig.oscillator(fj.friction.Coulomb(0.0))
    swing = fj.synthetic_run(free, 2e-3, rate=1e3, duration=2.0, noise=1e-8, seed=1)
    blow = fj.instrument.impact_test(0.41, 2574.0, 0.18, duration=40.0, rate=2000.0, noise=1e-3)
    shown = {
        "Displacement [mm] ": several,
        "Displacement [mm]": fj.simulate(MACHINE, 2e-3, np.linspace(0, 0.6, 1200)),
        "Friction force [mN]": MACHINE,
        "Friction force [mN] ": fj.Oscillator(0.4, 2500.0, 0.2, 10.0, law),
        "mu": batch,
        "": rig,
        "Mean friction force [mN]": fj.half_cycle_friction(files.run, rig),
        "Displacement [mm]  ": fj.data.inspect(files.run),
        "Residual [std]": force_fit,
        "Residual [nm]": fj.calibrate_ringdown(swing, drag=False, friction=False),
        "Receptance [mm/N]": fj.calibrate_frf(*receptance(blow, band=(8.0, 18.0))),
        " ": fj.calibrate_interferometer("632.9908(6) nm", pressure="1013.2(3) hPa"),
    }
    for label, result in shown.items():
        drawing = result.plot(style="column")
        assert drawing.get_size_inches()[0] * 25.4 == pytest.approx(85)
        assert label.strip() in [axes.get_ylabel() for axes in drawing.axes]
        assert "<svg" in result._repr_html_()


def test_a_batch_is_drawn_with_its_mean_and_those_that_failed_hollow(batch):
    axes = batch.plot().axes[0]
    heights = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) == 2]
    level = [low for low, high in heights if low == high]
    assert level == [pytest.approx(batch.population("mu").mean)]
    solid = next(line for line in axes.lines if line.get_markerfacecolor() == "#0072B2")
    np.testing.assert_array_equal(solid.get_ydata(), batch.values["mu"][batch.described])


def test_the_characteristic_of_a_machine_is_its_law():
    law = fj.friction.Stribeck(0.05, mu_s=0.06, v_stribeck=1e-3)
    line = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, law).plot().axes[0].lines[0]
    v, force = line.get_xdata(), line.get_ydata()
    assert force[-1] == pytest.approx(1e3 * 0.05 * 10) and force[0] == -force[-1]
    assert np.max(force[v == 0]) == pytest.approx(600) and np.min(force[v == 0]) == pytest.approx(-600)
