"""Each run of a chunk gets its row, reason and residuals."""

import os

import numpy as np
import pytest

import fricjax as fj
from fricjax.archive import Law, Study, work
from fricjax.archive.plan import plan

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]
RUNS = [fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in range(3)]


@pytest.fixture
def folder(tmp_path):
    """Write two files of one run, and one of two runs.

    The second run of the last file is constant.
    """
    place = tmp_path / "runs"
    place.mkdir()
    for number in (0, 1):
        fj.write(RUNS[number], place / f"run_{number}.npz")
    columns = np.column_stack([RUNS[2].t, 1e3 * RUNS[2].x, RUNS[2].t, np.full(RUNS[2].t.size, 1e-3)])
    heads = "Run 1: t (s),Run 1: x (mm),Run <b>2: t (s),Run <b>2: x (mm)"
    np.savetxt(place / "two.csv", columns, delimiter=",", header=heads, comments="", fmt="%.17g")
    return place


def rows_of(folder, **settings):
    study = Study(folder, (Law("coulomb", MACHINE, tuple(FREE)),), **settings)
    return {(row["file"], row["run"]): row for c in plan(study).chunks for row in work.Work(study)(c).rows}


def test_several_runs_of_a_file_are_several_rows(folder):
    rows = rows_of(folder)
    statuses = {name: row["status"] for name, row in rows.items()}
    assert statuses == {
        ("run_0.npz", ""): "ok",
        ("run_1.npz", ""): "ok",
        ("two.csv", "Run 1"): "ok",
        ("two.csv", "Run <b>2"): "rejected",
    }
    assert "x is constant" in rows["two.csv", "Run <b>2"]["outcome"]
    assert len({row["key"] for row in rows.values()}) == 4
    alone = fj.fit(RUNS[2], MACHINE, FREE)
    assert rows["two.csv", "Run 1"]["mu"] == pytest.approx(alone.values["mu"], rel=1e-9)


def test_residuals_are_those_of_a_fit(folder, tmp_path):
    import xarray

    archive = fj.batch(folder, tmp_path / "out", MACHINE, FREE, residuals=True)
    row = archive.to_dataframe().set_index("file").loc["run_0.npz"]
    fit = fj.fit(RUNS[0], MACHINE, FREE)
    with xarray.open_dataset(tmp_path / "out" / "runs" / f"{row['key']}.nc") as kept:
        measured = RUNS[0].x - fit.values["offset"]
        assert np.allclose(kept["x"], measured, rtol=0, atol=1e-15)
        after = np.isfinite(fit.residuals)
        assert np.allclose(kept["residual"].to_numpy()[after], fit.residuals[after], rtol=0, atol=1e-12)
        assert kept.attrs["sha256"] == row["sha256"] and kept["t"].attrs["units"] == "s"
    assert sorted(path.suffix for path in (tmp_path / "out" / "runs").iterdir()) == [".nc"] * 3


def test_a_fault_of_the_program_costs_one_run(folder, monkeypatch):
    fit_rows = work.fit_rows

    def faulty(records, requests):
        if any(record.meta.get("run") == "Run 1" for record in records):
            raise ZeroDivisionError("a fault\nof two lines")
        return fit_rows(records, requests)

    monkeypatch.setattr(work, "fit_rows", faulty)
    rows = rows_of(folder)
    assert rows["run_0.npz", ""]["status"] == rows["run_1.npz", ""]["status"] == "ok"
    failed = rows["two.csv", "Run 1"]
    assert failed["status"] == "failed"
    assert failed["outcome"].startswith("Unexpected ZeroDivisionError in fricjax/archive/work.py, line ")
    assert failed["outcome"].endswith(": a fault of two lines")


def test_files_that_go_or_change_while_they_are_read_are_rejected(folder, monkeypatch):
    (folder / "pipe.csv").symlink_to(folder / "nothing.csv")
    read = work.read

    def writing(path, **options):
        records = read(path, **options)
        if path.name == "run_0.npz":
            path.write_bytes(path.read_bytes() + b"more")
        return records

    monkeypatch.setattr(work, "read", writing)
    rows = rows_of(folder)
    assert rows["run_0.npz", ""]["status"] == "rejected"
    assert "was written to while it was read. Start again when it is complete." in rows["run_0.npz", ""]["outcome"]
    assert "There is no file" in rows["pipe.csv", ""]["outcome"]
    assert rows["run_1.npz", ""]["status"] == "ok"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_is_rejected(folder):
    (folder / "run_1.npz").chmod(0)
    assert "cannot be read" in rows_of(folder)["run_1.npz", ""]["outcome"]


def test_a_load_that_is_no_number_is_the_fault_of_its_run(folder):
    (folder / "load_oilN").mkdir()
    os.rename(folder / "run_0.npz", folder / "load_oilN" / "run_0.npz")
    rows = rows_of(folder, facts=("load_{load}N/run_{number}.npz",))
    assert "names the load 'oil', which is no positive number" in rows["load_oilN/run_0.npz", ""]["outcome"]
    assert rows["run_1.npz", ""]["status"] == "ok"


def test_without_a_machine_no_coefficient_is_claimed(folder):
    rows = rows_of(folder, calibrated=False)
    row = rows["run_0.npz", ""]
    assert row["status"] == "ok" and row["mu"] is row["stiffness_std"] is row["load"] is None
    assert row["dead_band"] == pytest.approx(0.05 * 10 / 2500, rel=1e-4)
