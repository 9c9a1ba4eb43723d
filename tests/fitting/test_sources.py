"""Runs given as path, table, arrays or record, and their names."""

import re

import numpy as np
import pandas as pd
import pytest

import fricjax as fj
from fricjax.data import inspect
from fricjax.energy_loss.energy import energy_of
from fricjax.energy_loss.regression import integral_friction
from fricjax.energy_loss.weak import weak_form
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb
from fricjax.rig import Measured
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, coulomb_run

pytestmark = pytest.mark.slow

RIG = fj.Rig(
    mass=PROTOTYPE_MASS, stiffness=Measured(2574.0, 2.0), normal_force=Measured(9.66, 0.01), damping=PROTOTYPE_DAMPING
)
SLIDING = RIG.oscillator(Coulomb(0.05))
STARTS = (2e-3, 2.5e-3, 1.8e-3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for i, x0 in enumerate(STARTS):
        run = coulomb_run(x0, seed=i)
        table = {"Time [s]": np.asarray(run.t), "Displacement [um]": 1e6 * np.asarray(run.x)}
        pd.DataFrame(table).to_csv(folder / f"run{i}.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def paths(folder):
    return sorted(folder.glob("*.csv"))


@pytest.fixture(scope="module")
def joint(paths) -> fj.Fit:
    return fj.fit(paths, SLIDING, MACHINE)


def test_the_fit_does_not_depend_on_how_the_run_is_given(paths):
    record = fj.read(paths[0])
    expected = fj.fit(record, SLIDING, MACHINE)
    table = pd.read_csv(paths[0])
    for source in (paths[0], str(paths[0]), [paths[0]], table, (record.t, record.x), record.trace):
        found = fj.fit(source, SLIDING, MACHINE)
        assert found.values == expected.values and found.std_errors == expected.std_errors
        assert np.array_equal(found.residuals, expected.residuals, equal_nan=True)
    assert expected.sources == ("run0.csv",) and "record:      run0.csv\n" in expected.summary()
    assert expected.plot().axes[0].get_title(loc="left").startswith("run0.csv, Coulomb friction")


def test_bare_displacements_are_fitted_with_their_rate_or_times(paths):
    traces = [fj.read(path).trace for path in paths[:2]]
    n = min(np.size(trace.x) for trace in traces)
    t, x = np.arange(n) / 5000.0, np.array([np.asarray(trace.x)[:n] for trace in traces])
    expected = fj.fit([(t, row) for row in x], SLIDING, MACHINE).values
    given = (
        {"data": x, "rate": 5000.0},
        {"data": list(x), "t": t},
        {"data": x, "t": [t, list(t)]},
        {"data": x, "t": np.tile(t, (2, 1))},
    )
    for each in given:
        assert fj.fit(oscillator=SLIDING, free=MACHINE, **each).values == expected
        assert fj.fit_batch(oscillator=SLIDING, free=MACHINE, **each).converged.tolist() == [True, True]
    alone = fj.fit((t, x[0]), SLIDING, MACHINE).values
    assert fj.fit(x[0].tolist(), SLIDING, MACHINE, rate=5000.0).values == alone
    best = fj.multistart(x[0], SLIDING, MACHINE, starts=1, rate=5000.0).best
    assert best.values == pytest.approx(alone, rel=1e-7)
    compared = fj.compare(x[0], [SLIDING], rate=5000.0, held_out=False).fits["Coulomb"].values
    assert compared == pytest.approx(alone, rel=1e-7)


REFUSED = {
    "no times": (
        {"data": np.zeros(9)},
        r"either their rate or their times: .* fricjax\.fit\(x, \.\.\., rate=5000\.0\)\.$",
    ),
    "both": ({"data": np.zeros(9), "t": np.zeros(9), "rate": 5.0}, r"either their rate or their times"),
    "fewer times": ({"data": np.zeros(9), "t": np.arange(8.0)}, r"There are 8 times and 9 displacements; give as many"),
    "times of another number of runs": (
        {"data": np.zeros((2, 9)), "t": [np.zeros(9)] * 3},
        "the times of 3 runs, but there are 2",
    ),
    "a record": (
        {"data": coulomb_run(), "rate": 5.0},
        r"rate= is no option for records\..* Options are sigma=, sign=, crop=, repair=\.$",
    ),
    "a word": (
        {"data": np.zeros(9), "rate": "fast"},
        r"rate must be a positive number of samples per second, but it is 'fast'\.",
    ),
    "rows without rate": (
        {"data": np.zeros((3, 9))},
        r"shape \(3, 9\); give one run at a time, or its rows .* rate=5000\.0\)\.$",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_displacements_without_times_are_refused(name):
    given, message = REFUSED[name]
    with pytest.raises((DataError, UsageError), match=message):
        fj.fit(oscillator=SLIDING, free=MACHINE, **given)


def test_a_joint_fit_names_its_runs(joint, tmp_path):
    assert joint.sources == joint.labels == ("run0.csv", "run1.csv", "run2.csv")
    report = joint.summary()
    assert "record:      run0.csv, run1.csv, run2.csv\n" in report
    for name, count in zip(joint.sources, joint.half_cycles, strict=True):
        assert f"half-cycles: {count} to the stop of {name}; margin" in report
    back = fj.load_fit(joint.save(tmp_path / "fit.json"))
    assert back.sources == joint.sources and back.summary() == report


def test_runs_without_a_name_of_their_own_have_a_number(paths):
    traces = [fj.read(path).trace for path in paths[:2]]
    found = fj.fit([*traces, paths[0], paths[0]], SLIDING, MACHINE)
    assert found.sources == ("", "", "run0.csv", "run0.csv")
    assert found.labels == ("run 0", "run 1", "run 2 (run0.csv)", "run 3 (run0.csv)")


def test_sentences_name_the_run(paths, folder):
    record = fj.read(paths[1])
    short = fj.data.crop(record, None, float(record.segmentation.turning_times[1]))
    with pytest.raises(DataError, match=r"The fitted window of run1\.csv holds \d complete half-cycle"):
        fj.fit([paths[0], short], SLIDING, MACHINE)
    off = fj.Record(coulomb_run(2.5e-3, mu=0.06), {"source": "off.csv"})
    missed = fj.fit([paths[0], off, paths[2]], SLIDING, MACHINE, throw=False)
    assert re.search(r" of (run0|off|run2)\.csv", missed.status)
    with pytest.raises(DataError, match=r"There is no final displacement of run1\.csv, which does not come to rest"):
        fj.pairs_of([paths[0], short])
    notes = fj.half_cycle_friction([paths[0], fj.data.crop(record, None, 0.05)], RIG).notes
    assert len(notes) == 1 and notes[0].startswith("Left out run1.csv: ")


def test_a_batch_names_its_files(paths, folder):
    records = [fj.read(path) for path in paths]
    expected = fj.fit_batch(records, SLIDING, MACHINE)
    found = fj.fit_batch(folder.glob("*.csv"), SLIDING, MACHINE)
    order = [found.sources.index(record.name) for record in records]
    assert np.array_equal(found.values["mu"][order], expected.values["mu"])
    mixed = fj.fit_batch([folder / "none.csv", paths[0], (records[1].t, records[1].x), 3.0], SLIDING, MACHINE)
    table = mixed.to_dataframe()
    assert table["source"].tolist() == ["none.csv", "run0.csv", "", ""] and table.columns[0] == "source"
    assert mixed.status[0].startswith("rejected: There is no file") and "none.csv" in mixed.status[0]
    assert mixed.status[3].startswith("rejected: A record cannot be made of float.")
    assert np.array_equal(mixed.values["mu"][1:3], expected.values["mu"][:2])
    assert fj.fit_batch(paths[0], SLIDING, MACHINE).sources == ("run0.csv",)
    with pytest.raises(UsageError, match=r"No run could be fitted\. The first was rejected: There is no file"):
        fj.fit_batch("none.csv", SLIDING, MACHINE)


def test_comparisons_name_their_files(paths, joint):
    found = fj.compare(paths, [SLIDING], held_out=False)
    assert found.sources == joint.sources and found.to_dict()["sources"] == list(joint.sources)
    assert "Fitted to run0.csv, run1.csv, run2.csv. Distances of AICc" in found.summary()
    routes = fj.compare_routes(paths, RIG)
    assert routes.sources == joint.sources and "\nruns:         run0.csv, run1.csv, run2.csv\n" in routes.summary()
    assert routes.to_dict() == fj.compare_routes([fj.read(path) for path in paths], RIG).to_dict()


TAKES_A_RUN = {
    "fit": lambda run: fj.fit(run, SLIDING, MACHINE),
    "multistart": lambda run: fj.multistart(run, SLIDING, MACHINE),
    "moving floor": lambda run: fj.fit_on_moving_floor(run, np.zeros(3), SLIDING, MACHINE),
    "compare": lambda run: fj.compare(run, [SLIDING]),
    "compare_routes": lambda run: fj.compare_routes(run, RIG),
    "pairs_of": lambda run: fj.pairs_of(run),
    "fit_release": lambda run: fj.fit_release(run, None),  # pyright: ignore[reportArgumentType]
    "half-cycles": lambda run: fj.half_cycle_friction(run, RIG),
    "force map": lambda run: fj.friction_force_map(run, RIG),
    "no contact": lambda run: fj.friction_force_map(coulomb_run(), RIG, run),
    "energy": lambda run: energy_of(run, RIG),
    "integral": lambda run: integral_friction(run, RIG),
    "weak form": lambda run: weak_form(run, RIG),
    "ring-down": lambda run: fj.calibrate_ringdown(run),
    "inspect": lambda run: inspect(run),
    "write": lambda run: fj.write(run, "never.csv"),
}


@pytest.mark.parametrize("name", TAKES_A_RUN)
def test_a_path_is_read_wherever_a_run_is_taken(name, folder):
    with pytest.raises(DataError, match=r"There is no file .*run7\.csv\. Did you mean 'run\d\.csv'\? Check the path\."):
        TAKES_A_RUN[name](folder / "run7.csv")


def test_the_routes_read_what_they_are_given(paths, tmp_path):
    record = fj.read(paths[0])
    assert np.array_equal(fj.half_cycle_friction(paths[0], RIG).force, fj.half_cycle_friction(record, RIG).force)
    assert np.array_equal(fj.friction_force_map(paths, RIG).force, fj.friction_force_map(paths[:], RIG).force)
    assert np.array_equal(energy_of((record.t, record.x), RIG).energy, energy_of(record, RIG).energy)
    assert fj.pairs_of(paths[0]).x0 == fj.pairs_of([record.trace]).x0
    assert inspect((record.t, record.x)).n_half_cycles == inspect(record).n_half_cycles
    assert np.array_equal(fj.read(fj.write((record.t, record.x), tmp_path / "copy.npz")).x, record.x)
