"""Workers over loopback give the same rows, even if processes die."""

import contextlib
import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

import fricjax as fj
from fricjax.archive import execute, scheduler, workers
from fricjax.archive.driver import plan_of
from fricjax.archive.study import Law, Study
from fricjax.archive.work import Work
from fricjax.errors import UsageError
from tests.archive.deadly import Deadly, Slow, Unlucky, compiled

ROOT = Path(__file__).resolve().parents[2]
MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]
# Columns that differ between processes.
PASSING = ["seconds_read", "seconds_fit", "finished_at", "host", "worker"]
# A single death splits a chunk.
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Write six runs and two broken ones."""
    folder = tmp_path_factory.mktemp("archive") / "runs"
    folder.mkdir()
    for seed in range(6):
        run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed)
        fj.write(run, folder / f"run_{seed}.npz")
    (folder / "run_7.csv").write_text("t,x\n1,2\n")
    (folder / "run_8.npz").write_bytes(b"PK")
    return folder


@pytest.fixture(scope="module")
def expected(runs, tmp_path_factory):
    """Return the rows computed in this process."""
    return rows(fj.batch(runs, tmp_path_factory.mktemp("alone") / "out", MACHINE, FREE))


def rows(archive):
    table = archive.to_dataframe().drop(columns=PASSING)
    return table.sort_values("file").reset_index(drop=True)


def dask(*words, **environment):
    command = [sys.executable, "-m", "dask", *words]
    return subprocess.Popen(command, env={**ENVIRONMENT, **environment}, stderr=subprocess.DEVNULL)


def end(process):
    """Terminate a process, and kill it if that takes too long."""
    process.terminate()
    try:
        process.wait(timeout=20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextlib.contextmanager
def cluster(folder, workers):
    """Start a scheduler and workers that restart; yield its address and process."""
    file = folder / "scheduler.json"
    local = ("--host", "127.0.0.1", "--no-dashboard")
    started = [dask("scheduler", "--port", "0", "--scheduler-file", str(file), *local)]
    while not file.exists():
        time.sleep(0.05)
    where = pd.read_json(file, typ="series")["address"]
    preload = ("--preload", "fricjax.archive.execute", "--local-directory", str(folder))
    started += [dask("worker", where, "--nworkers", str(workers), "--nthreads", "1", *local, *preload)]
    yield where, started[0]
    for process in reversed(started):
        end(process)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("dask"), 2) as (where, _):
        yield where


@pytest.mark.slow
def test_workers_elsewhere_give_the_rows_of_this_process(runs, expected, address, tmp_path, monkeypatch):
    # The workers have another current folder.
    monkeypatch.chdir(runs.parent)
    archive = fj.batch("runs", tmp_path / "out", MACHINE, FREE, execute=scheduler(address))
    pd.testing.assert_frame_equal(rows(archive), expected)
    table = archive.to_dataframe()
    assert str(os.getpid()) not in set(table["worker"])


def by(address, kind):
    """Return an executor with another kind of work."""
    connected = scheduler(address)
    return lambda chunks, work: connected(chunks, kind(work.study))


@pytest.mark.slow
def test_a_chunk_whose_worker_dies_is_done_again_and_written_once(runs, expected, address, tmp_path):
    (runs.parent / "killed").unlink(missing_ok=True)
    archive = fj.batch(runs, tmp_path / "out", MACHINE, FREE, execute=by(address, Unlucky))
    assert (runs.parent / "killed").exists()
    pd.testing.assert_frame_equal(rows(archive), expected)
    parts = [pd.read_parquet(part) for part in (tmp_path / "out" / "parts").glob("*.parquet")]
    assert len(pd.concat(parts)) == len(expected)


@pytest.mark.slow
def test_a_file_that_kills_its_worker_has_failed_and_the_others_are_fitted(runs, expected, address, tmp_path):
    names = [runs / name for name in ("run_0.npz", "run_1.npz")]
    deadly = tmp_path / "runs" / "deadly.npz"
    deadly.parent.mkdir()
    deadly.write_bytes(names[0].read_bytes())
    for name in names:
        (deadly.parent / name.name).write_bytes(name.read_bytes())
    archive = fj.batch(deadly.parent, tmp_path / "out", MACHINE, FREE, execute=by(address, Deadly))
    table = archive.to_dataframe().set_index("file")
    assert table["status"].to_dict() == {"deadly.npz": "failed", "run_0.npz": "ok", "run_1.npz": "ok"}
    assert str(table["outcome"]["deadly.npz"]).startswith(
        "The process that read and fitted it died each time, also while"
    )
    assert table["mu"]["run_0.npz"] == expected.set_index("file")["mu"]["run_0.npz"]


@pytest.mark.slow
def test_a_scheduler_that_dies_loses_nothing_that_was_done(runs, expected, tmp_path, capfd):
    with cluster(tmp_path, 1) as (where, process):
        left = by(where, Slow)
        kill = lambda *_: process.kill()
        with pytest.raises(UsageError, match=r"The scheduler of the workers is gone\. Finished chunks are kept"):
            fj.batch(runs, tmp_path / "out", MACHINE, FREE, execute=left, tell=kill)
    assert capfd.readouterr().err == ""
    done = fj.open_archive(tmp_path / "out").to_dataframe()
    assert 0 < len(done) < len(expected)
    pd.testing.assert_frame_equal(rows(fj.batch(runs, tmp_path / "out", MACHINE, FREE)), expected)


@pytest.mark.slow
def test_a_worker_that_joins_compiles_nothing(runs, expected, address, tmp_path):
    """All workers share a folder of compiled programs."""
    from distributed import Client

    study = Study(runs, (Law("coulomb", MACHINE, tuple(FREE)),), ("run_0.npz", "run_1.npz"))
    chunk, other = plan_of(study, tmp_path / "none").chunks
    process = dask("worker", address, "--nthreads", "1", "--no-nanny", "--name", "late", "--no-dashboard",
                   "--local-directory", str(tmp_path))  # fmt: skip
    with Client(address, set_as_default=False) as client:
        while "late" not in [each["name"] for each in client.scheduler_info()["workers"].values()]:
            time.sleep(0.05)
        asked = [client.submit(compiled, Work(study), each, workers=["late"], pure=False) for each in (chunk, other)]
        (first, _, made), (second, _, more) = [each.result() for each in asked]
        end(process)
    assert first == second == ["ok"]
    # Plain runs need no program at all.
    assert made == more == 0


@pytest.mark.slow
def test_workers_of_this_machine(runs, expected, tmp_path):
    archive = fj.batch(runs, tmp_path / "out", MACHINE, FREE, execute=workers(2))
    pd.testing.assert_frame_equal(rows(archive), expected)
    assert str(os.getpid()) not in set(archive.to_dataframe()["worker"])


def place(dask_worker):
    return dask_worker.name, sorted(os.sched_getaffinity(0))


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system cannot bind a process to a core")
def test_workers_of_this_machine_have_a_core_each():
    """Without separate cores, the threads of two workers would compete."""
    usable = sorted(os.sched_getaffinity(0))
    with execute._connected(3) as client:
        places = dict(client.run(place).values())
    assert places == {number: [usable[number % len(usable)]] for number in range(3)}


def test_no_scheduler(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(execute, "_ANSWERS", 0.2)
    with pytest.raises(UsageError, match=r"No scheduler answers at tcp://127\.0\.0\.1:9\. Start one: dask scheduler"):
        fj.batch(runs, tmp_path / "out", MACHINE, FREE, execute=scheduler("tcp://127.0.0.1:9"))
    with pytest.raises(UsageError, match="'somewhere' is no address of a scheduler"):
        scheduler("somewhere")


@dataclasses.dataclass
class Client:
    """Client with given answers of its workers."""

    answers: dict

    def run(self, *_):
        return self.answers


def test_workers_that_would_give_other_results_are_refused():
    refuse = execute._check_workers
    with pytest.raises(UsageError, match=r"tcp://a:1 has fricjax 0\.0\.1, and this is"):
        refuse(Client({"tcp://a:1": ("0.0.1", True)}), Path("runs"))  # pyright: ignore[reportArgumentType]
    with pytest.raises(UsageError, match=r"tcp://a:1 does not see runs\. Put the runs where all workers find them"):
        refuse(Client({"tcp://a:1": (fj.__version__, False)}), Path("runs"))  # pyright: ignore[reportArgumentType]
