"""Hostile files of an archive get their rows and do no harm."""

import csv
import html
import os
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

import fricjax as fj
from experiments.files.hostile import FILES
from experiments.files.hostile_archives import Touches
from experiments.files.hostile_trees import BOMBS, matlab_of
from fricjax.archive.archive import write_csv
from fricjax.archive.execute import in_this_process
from tests.cli.conftest import call

pytestmark = pytest.mark.slow

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
HTML, FORMULA, ESCAPE = "<img src=x onerror=alert(1)>", "=HYPERLINK('http://a.b','c')", "\x1b[2Jcleared"
SECRET = "-----BEGIN PRIVATE KEY-----\n"
SORTS = ("tables", "no files", "archives", "HDF5", "MATLAB", "formats")
MANY = {name: hostile for sort in SORTS for name, hostile in FILES[sort].items()}
BOMBED = {name: BOMBS[name] for name in ("bomb.h5", "chunk_bomb.h5", "bomb5.mat", "bytes5.mat", "sparse.h5")}


def wide(path):
    """Write a table of a million columns."""
    path.write_text(",".join(["1"] * 1_000_000) + "\n" + ",".join(["2"] * 1_000_000) + "\n")


def pickled(path):
    """Write a data set that would create a file when unpickled."""
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(40) / 1e3
        file.create_dataset("x", data=np.void(b"\x80\x04cos\nsystem\n(S'touch PWNED'\ntR."))


def named(path):
    """Write three runs named like HTML, a formula and an escape sequence."""
    run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    with h5py.File(path, "w") as file:
        for name in (HTML, FORMULA.replace("/", "|"), ESCAPE):
            file[f"{name}/t"], file[f"{name}/x"] = run.t, run.x


EXTRA = {
    "wide.csv": (wide, "a line of more than 1 MB"),
    "pickled.h5": (pickled, "no displacement|has 40 samples"),
    "objects.npz": (lambda path: np.savez(path, t=np.arange(3.0), x=np.array([Touches()], object)), "pickled objects"),
    "handle.mat": (lambda path: matlab_of(16, b"@(x) system('touch PWNED')")(path), "no displacement|has 40 samples"),
    "opaque.mat": (lambda path: matlab_of(17, b"MCOS")(path), "cannot be read as a MATLAB file"),
    "link.csv": (lambda path: path.symlink_to("../secret.csv"), "is a link that leads out of the folder of the runs"),
    "=cmd|'!A0'.csv": (lambda path: path.write_text("text\n"), "holds no rows of numbers"),
    f"{HTML}.csv": (lambda path: path.write_text("text\n"), "holds no rows of numbers"),
}


@pytest.fixture(scope="module", params=["few", pytest.param("all", marks=pytest.mark.slow)])
def hostile(request):
    """Return hostile files by name: those of this module, or all."""
    return EXTRA if request.param == "few" else {**MANY, **BOMBED, **EXTRA}


@pytest.fixture(scope="module")
def archive(tmp_path_factory, hostile):
    """Fit a folder of hostile files."""
    place = tmp_path_factory.mktemp("hostile")
    (place / "secret.csv").write_text(SECRET)
    (place / "runs").mkdir()
    (place / "current").mkdir()
    for name, (build, _) in hostile.items():
        build(place / "runs" / name)
    named(place / "runs" / "named.h5")
    before = listed(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place / "current")
        made = fj.batch(place / "runs", place / "out", MACHINE, residuals=True)
    assert {path for path in listed(place) - before if not path.startswith(f"out{os.sep}")} <= {"out"}
    return made


def listed(place):
    return {
        os.path.relpath(os.path.join(folder, name), place)
        for folder, folders, files in os.walk(place)
        for name in (*folders, *files)
    }


def test_every_hostile_file_has_its_row_with_its_reason(archive, hostile):
    table = archive.to_dataframe()
    found = dict(iter(table.groupby("file")))
    expected = {name: words for name, (_, words) in hostile.items()}
    # A folder is no run, and a link to a device leads out of the archive.
    expected.pop("folder.csv", None)
    others = {"device.csv": "leads out of the folder", "sparse.h5": r"has 1.1e\+03 GB, and at most 68.7 GB are"}
    expected |= {name: words for name, words in others.items() if name in expected}
    assert set(found) == {*expected, "named.h5"}
    wrong = {}
    for name, words in expected.items():
        status, outcome = found[name].iloc[0][["status", "outcome"]]
        # A readable file is too short for a fit, or holds several runs.
        if status == "failed" or (words and not (status == "rejected" and re.search(words, outcome))):
            wrong[name] = f"{status}: {outcome[:150]}"
    assert not wrong


def test_nothing_of_what_lies_elsewhere_is_in_the_store(archive):
    for folder, _, names in os.walk(archive.path):
        for name in names:
            assert b"PRIVATE KEY" not in Path(folder, name).read_bytes()


def test_names_that_are_code_are_only_names(archive, tmp_path):
    rows = archive.to_dataframe().set_index("file").loc["named.h5"]
    assert rows["status"].tolist() == ["ok"] * 3
    assert HTML in set(rows["run"])
    keys = {name.removesuffix(".nc") for name in os.listdir(archive.path / "runs")}
    assert set(rows["key"]) <= keys and all(re.fullmatch("[0-9a-f]{64}", key) for key in keys)
    path = write_csv(archive.to_dataframe()[["file", "run", "outcome"]], tmp_path / "table.csv")
    with path.open(newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]
    assert f"'{FORMULA.replace('/', '|')}" in cells
    asked = call("query", "select file, run from runs where status = 'ok'", archive.path)
    assert asked.code == 0 and "\x1b" not in asked.out and r"\x1b[2Jcleared" in asked.out


def test_a_query_reads_and_writes_nothing_else(archive, tmp_path):
    for sql in (
        f"copy runs to '{tmp_path}/stolen.csv'",
        "select * from read_csv('/etc/passwd')",
        "install httpfs",
        f"attach '{tmp_path}/other.db'",
        "set enable_external_access = true",
    ):
        assert call("query", sql, archive.path).code == 2
    assert not os.listdir(tmp_path)


def test_the_report_escapes_names(archive, tmp_path):
    path = tmp_path / "page.html"
    called = call("report", archive.path, "--out", path)
    assert called.code == 0, called.out + called.err
    page = path.read_text()
    assert HTML not in page and "\x1b" not in page
    assert html.escape(HTML) in page or "\\u003cimg" in page or "&lt;img" in page


def test_a_file_that_was_named_is_followed_wherever_it_leads(tmp_path):
    run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    fj.write(run, tmp_path / "run.csv")
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "run.csv").symlink_to("../run.csv")
    archive = fj.batch([tmp_path / "links" / "run.csv"], tmp_path / "out", MACHINE, execute=in_this_process)
    assert archive.counts["ok"] == 1
