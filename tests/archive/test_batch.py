"""A batch fits each run of a folder once."""

import os
import platform

import numpy as np
import pytest

import fricjax as fj
from fricjax.archive.store import Store
from fricjax.errors import DataError, UsageError

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]


@pytest.fixture
def folder(tmp_path):
    """Write five runs under two loads; two of them are broken."""
    place = tmp_path / "runs"
    for load, seeds in ((10, (0, 1)), (12, (2,))):
        (place / f"load_{load}N").mkdir(parents=True)
        machine = fj.Oscillator(0.4, 2500.0, 0.2, float(load), fj.friction.Coulomb(0.05))
        for seed in seeds:
            run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed)
            fj.write(run, place / f"load_{load}N" / f"run_{seed}.npz")
    (place / "load_10N" / "run_7.csv").write_text("t,x\n1,2\n")
    (place / "load_10N" / "run_8.npz").write_bytes(b"PK")
    return place


def batch(folder, out, **settings):
    return fj.batch(folder, out, MACHINE, FREE, facts=["load_{load}N/run_{number}.*"], **settings)


class Watched:
    """Executor that records the names of its files."""

    def __init__(self):
        self.files = []

    def __call__(self, chunks, work):
        for chunk in chunks:
            self.files += [job.file for job in chunk]
            yield chunk, work(chunk)


def test_every_run_has_its_row(folder, tmp_path):
    archive = batch(folder, tmp_path / "out")
    rows = archive.to_dataframe().set_index("file")
    assert rows["status"].to_dict() == {
        "load_10N/run_0.npz": "ok",
        "load_10N/run_1.npz": "ok",
        "load_10N/run_7.csv": "rejected",
        "load_10N/run_8.npz": "rejected",
        "load_12N/run_2.npz": "ok",
    }
    good = rows[rows["status"] == "ok"]
    # The path sets the load of the machine; the load of the study would make mu a fifth too large.
    assert np.all(np.abs(good["mu"] - 0.05) < 5 * good["mu_std"])
    assert good["load"].tolist() == [10.0, 10.0, 12.0]
    assert rows["number"].tolist() == [0, 1, 7, 8, 2]
    assert archive.failures()["file"].tolist() == ["load_10N/run_7.csv", "load_10N/run_8.npz"]
    assert "holds" in archive.failures()["outcome"][0]
    picture = good.iloc[0]
    times = np.asarray(picture["sketch_t"])
    record = fj.read(folder / "load_10N" / "run_0.npz")
    read = np.interp(times, record.t - record.t[0], record.x) - picture["offset"]
    assert np.allclose(picture["sketch_x"], read, atol=1e-9)
    left = np.asarray(picture["sketch_residual"])
    assert 0.5e-9 < np.nanstd(left) < 2e-9 and np.isnan(left[0])


def test_rows_are_those_of_fit_batch(folder, tmp_path):
    rows = fj.batch(folder / "load_10N", tmp_path / "out", MACHINE, FREE, include=["*.npz"]).to_dataframe()
    rows = rows[rows["status"] == "ok"]
    expected = fj.fit_batch([folder / "load_10N" / f"run_{i}.npz" for i in (0, 1)], MACHINE, FREE).to_dataframe()
    shared = [name for name in expected if name in rows and expected[name].dtype.kind == "f"]
    assert len(shared) > 20
    assert all(np.array_equal(rows[name], expected[name], equal_nan=True) for name in shared)


def test_nothing_is_fitted_twice(folder, tmp_path):
    first, watched = batch(folder, tmp_path / "out"), Watched()
    batch(folder, tmp_path / "out", execute=watched)
    os.utime(folder / "load_10N" / "run_0.npz")
    os.rename(folder / "load_12N" / "run_2.npz", folder / "load_12N" / "run_3.npz")
    again = batch(folder, tmp_path / "out", execute=watched)
    assert watched.files == []
    rows = again.to_dataframe()
    assert "load_12N/run_3.npz" in set(rows["file"]) and "load_12N/run_2.npz" not in set(rows["file"])
    assert rows["number"].tolist() == [0, 1, 7, 8, 3] and len(rows) == len(first)


def test_a_changed_file_is_fitted_again(folder, tmp_path):
    batch(folder, tmp_path / "out")
    other = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=9)
    fj.write(other, folder / "load_10N" / "run_0.npz", overwrite=True)
    watched = Watched()
    archive = batch(folder, tmp_path / "out", execute=watched)
    assert watched.files == ["load_10N/run_0.npz"]
    assert len(archive) == 5 and archive.counts["ok"] == 3


def test_other_settings_are_refused(folder, tmp_path):
    batch(folder, tmp_path / "out")
    with pytest.raises(UsageError, match=r"records of another study: start was 'first_reversal', and is 'release' now"):
        batch(folder, tmp_path / "out", start="release")
    with pytest.raises(UsageError, match="the law coulomb was fitted with other coefficients or free parameters"):
        fj.batch(folder, tmp_path / "out", MACHINE, ["mu", "stiffness"], facts=["load_{load}N/run_{number}.*"])


@pytest.mark.slow
def test_other_laws_are_added(folder, tmp_path):
    batch(folder, tmp_path / "out")
    law = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.QuadraticDrag(0.0) + fj.friction.Coulomb(0.05))
    both = fj.batch(
        folder, tmp_path / "out", [MACHINE, law], FREE, facts=["load_{load}N/run_{number}.*"], include=["**/*.npz"]
    )
    assert both.to_dataframe().groupby("friction").size().to_dict() == {"coulomb": 5, "quadraticdrag+coulomb": 4}


def test_two_drivers_do_not_share_a_store_but_by_shards(folder, tmp_path):
    out = tmp_path / "out"
    words = r"Another driver is at work on .*out, process .*--shard 1/2"
    with Store(out).locked(), pytest.raises(UsageError, match=words):
        batch(folder, out)
    with Store(out).locked((1, 2)):
        half = batch(folder, out, shard=(2, 2))
        with pytest.raises(UsageError, match="Another driver"):
            batch(folder, out, shard=(1, 2))
    assert 0 < len(half) < 5
    process = f"process {os.getpid()} on {platform.node()}"
    assert half.driver == process and f"at work: {process}" in half.summary()
    both = batch(folder, out, shard=(1, 2))
    assert len(both) == 5 and both.driver == ""


def test_a_store_is_made_only_where_nothing_is(folder, tmp_path):
    with pytest.raises(UsageError, match="exists and holds no archive"):
        batch(folder, folder)
    assert not (folder / ".lock").exists()
    with pytest.raises(DataError, match="holds no archive"):
        fj.open_archive(folder)
    with pytest.raises(UsageError, match="There is no folder"):
        batch(tmp_path / "nothing", tmp_path / "out2")


def test_settings_that_no_study_has_are_refused(folder, tmp_path):
    with pytest.raises(
        UsageError, match=r"batch has no setting 'residual'\. Did you mean 'residuals'\? Known are rig, "
    ):
        batch(folder, tmp_path / "out", residual=True)
    study = fj.archive.Study(folder, (fj.archive.Law("coulomb", MACHINE, tuple(FREE)),))
    with pytest.raises(UsageError, match="The study already defines the model and its settings: leave"):
        fj.archive.run(study, tmp_path / "out", noise="white")
    assert not (tmp_path / "out").exists()
