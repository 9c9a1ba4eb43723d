"""`fricjax batch`, `status` and `query`: output, refusals and exit codes."""

import csv
import json
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import fricjax as fj
from fricjax.cli.batch import _two_interrupts
from fricjax.data.read import example_paths
from tests.tables import check_rows

RUN, RIG = example_paths()
MACHINE = fj.Rig.from_toml(RIG).oscillator(fj.friction.Coulomb(0.05))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write two runs, one named like a formula, and a broken one."""
    place = tmp_path_factory.mktemp("archive") / "runs"
    place.mkdir()
    for seed, name in enumerate(("run_0.npz", "=cmd_1.npz")):
        fj.write(fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed), place / name)
    (place / "broken.csv").write_text("t,x\n1,<script>\n")
    return place


@pytest.fixture(scope="module")
def store(folder, fricjax):
    """Fit the folder and return its store."""
    out = folder.parent / "out"
    assert fricjax("batch", folder, "--rig", RIG, "--out", out).code == 1
    return out


def test_a_batch_ends_with_one_where_a_run_is_not_ok(folder, store, fricjax):
    again = fricjax("batch", folder, "--rig", RIG, "--out", store)
    assert (
        again.code == 1
        and "broken.csv: rejected: " in again.out
        and "coulomb   2        0         1       0" in again.out
    )
    called = json.loads(fricjax("batch", folder, "--rig", RIG, "--out", store, "--json").out)
    assert called["counts"] == {"ok": 2, "invalid": 0, "rejected": 1, "failed": 0}
    good = fricjax("batch", folder, "--include", "*.npz", "--rig", RIG, "--out", folder.parent / "good", "--json")
    assert good.code == 0 and good.err == ""


def test_a_dry_run_does_nothing(folder, fricjax):
    out = folder.parent / "dry"
    called = fricjax("batch", folder, "--rig", RIG, "--out", out, "--dry-run", "--json")
    assert called.code == 0 and not out.exists()
    assert json.loads(called.out)["to_do"] == 3


def test_status_and_query(store, fricjax, tmp_path):
    assert "1 of 3 rows are not ok" in fricjax("status", store).out
    asked = fricjax(
        "query", "select file, status, mu from runs order by file", store, "--json", "--csv", tmp_path / "a.csv"
    )
    assert asked.code == 0
    rows = json.loads(asked.out)["rows"]
    assert [row[:2] for row in rows] == [["=cmd_1.npz", "ok"], ["broken.csv", "rejected"], ["run_0.npz", "ok"]]
    assert rows[1][2] is None and rows[0][2] == pytest.approx(0.05, rel=1e-4)
    with open(tmp_path / "a.csv", newline="") as file:
        assert [row[0] for row in csv.reader(file)] == ["file", "'=cmd_1.npz", "broken.csv", "run_0.npz"]


QUERIES = [
    "select * from read_csv('{file}')",
    "copy runs to '{file}.out'",
    "attach '{file}.db'",
    "install httpfs",
    "set enable_external_access = true",
    "select * from read_parquet('{file}')",
]
WRONG_USAGE = [
    (["{runs}", "--rig", RIG], "batch needs a folder for its results: add --out results."),
    (["{runs}s", "--rig", RIG, "--out", "{out}"], "There is no folder or file '{runs}s'. Did you mean 'runs'?"),
    (["{runs}", "--rig", RIG, "--out", "{out}", "--shard", "3/2"], "--shard '3/2' is no part"),
    (["{runs}", "--rig", RIG, "--out", "{out}", "--free", "muh"], "no coefficient 'muh'"),
    (["{runs}", "--rig", RIG, "--out", "{out}", "--facts", "run"], "The template 'run' names no fact"),
    (["{runs}", "--rig", RIG, "--out", "{runs}"], "exists and holds no archive"),
    (
        ["{runs}", "--rig", RIG, "--out", "{store}", "--start", "release"],
        "start was 'first_reversal', and is 'release' now",
    ),
]


def test_a_query_reads_only_the_table(store, fricjax, tmp_path):
    secret = tmp_path / "secret.csv"
    secret.write_text("a\nsecret\n")

    def check(sql):
        called = fricjax("query", sql.format(file=secret), store)
        assert called.code == 2 and "secret\n" not in called.out + called.err
        assert [path.name for path in tmp_path.iterdir()] == ["secret.csv"]

    check_rows(check, QUERIES)


def test_wrong_usage(folder, store, fricjax):
    places = {"runs": folder, "out": folder.parent / "never", "store": store}

    def check(words, sentence):
        called = fricjax("batch", *(str(word).format(**places) for word in words))
        assert called.code == 2 and sentence.format(**places) in called.err
        assert not (folder.parent / "never").exists()

    check_rows(check, WRONG_USAGE)


def test_ctrl_c_says_how_to_go_on(folder, fricjax, monkeypatch):
    from fricjax.archive import driver

    def interrupted(chunks, work):
        yield chunks[0], work(chunks[0])
        raise KeyboardInterrupt

    out = folder.parent / "interrupted"
    monkeypatch.setattr(driver, "in_this_process", interrupted)
    called = fricjax("batch", folder, "--rig", RIG, "--out", out)
    assert called.code == 130
    assert "Interrupted. 1 of 3 files are done" in called.err or "Interrupted. 2 of 3 files are done" in called.err
    assert f"kept in {out}; the same command goes on with the others." in called.err
    assert 0 < len(fj.open_archive(out)) < 3
    monkeypatch.undo()
    fricjax("batch", folder, "--rig", RIG, "--out", out)
    assert len(fj.open_archive(out)) == 3


def test_a_missing_package_is_one_sentence(store, fricjax, monkeypatch):
    monkeypatch.setitem(sys.modules, "duckdb", None)
    called = fricjax("query", "select 1", store)
    assert called.code == 2 and called.err == "Error: A query needs the package duckdb: pip install 'fricjax[batch]'.\n"
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    called = fricjax("status", store)
    assert called.code == 2 and "pip install 'fricjax[batch]'" in called.err


@pytest.fixture
def interrupted_by() -> Iterator[Callable[..., Any]]:
    """Return a function that sets the handler of Ctrl-C.

    Ctrl-C is ignored if the tests run in the background.
    """
    before = signal.getsignal(signal.SIGINT)
    yield lambda handler: signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_finishes_running_work_and_a_second_one_ends_at_once(monkeypatch, interrupted_by):
    interrupted_by(signal.default_int_handler)
    printed = []
    # Threads of Dask from other tests may write to stderr at any time.
    monkeypatch.setattr("fricjax.cli.batch.tell", lambda stream, text: printed.append((stream, text)))
    with pytest.raises(KeyboardInterrupt), _two_interrupts():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        ((stream, text),) = printed
        assert stream is sys.stderr and "finished and kept first; Ctrl-C once more ends at once" in text
        signal.raise_signal(signal.SIGINT)
    assert len(printed) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_batch_in_the_background_goes_on_ignoring_ctrl_c(interrupted_by):
    interrupted_by(signal.SIG_IGN)
    with _two_interrupts():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
