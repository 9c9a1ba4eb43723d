"""Commands replace files only with --force, and survive a full disk."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from fricjax.cli import demo
from fricjax.cli.failure import failure_of
from fricjax.cli.main import app
from fricjax.data.read import example_paths
from fricjax.show import files
from tests.tables import check_rows

RUN, RIG = example_paths()
# The inputs do not exist: a refusal comes before any input is read.
WRITING = {
    "inspect": [("none.csv", "--plot", "old.png")],
    "check": [("--x0", "2 mm", "--plot", "old.png")],
    "fit": [
        ("none.csv", "--plot", "old.png"),
        ("none.csv", "--out", "old.json"),
        ("none.csv", "--save", "old.npz"),
        ("none.csv", "none.csv", "--plot", "more.png"),
    ],
    "compare": [("none.csv", "--plot", "old.png")],
    "map": [("none.csv", "--plot", "old.png")],
    "energy": [("none.csv", "--plot", "old.png"), ("none.csv", "--out", "old.json")],
    "simulate": [("--x0", "2 mm", "--plot", "old.png"), ("--x0", "2 mm", "--out", "old.npz")],
    "calibrate ringdown": [("none.csv", "--mass", "1", "--normal-force", "9", "--out", "old.toml")],
    "calibrate frf": [("none.csv", "--normal-force", "9", "--out", "old.toml")],
    "demo": [("--out", ".")],
    "budget": [("none.json", "--plot", "old.png"), ("none.json", "--latex", "old.tex")],
    "report": [("none.json", "--out", "old.html")],
    "query": [("select 1", "none", "--csv", "old.csv")],
}
OLD = ("old.png", "old.json", "old.npz", "old.toml", "old.tex", "old.html", "old.csv", "more-2.png")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder in which all names are in use."""
    for name in OLD:
        (tmp_path / name).write_text("old")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_file_that_exists_is_refused_before_any_work(fricjax, folder):
    def check(command, words):
        called = fricjax(*command.split(), *words)
        assert called.code == 2
        assert "add --force" in called.err.lower() and "Traceback" not in called.err
        report = json.loads(fricjax(*command.split(), *words, "--json").out)
        assert (report["kind"], report["exit_code"]) == ("usage", 2)
        assert contents(folder) == dict.fromkeys(OLD, "old")

    check_rows(check, [(command, words) for command, each in WRITING.items() for words in each])


def test_every_command_that_writes_is_tried_above():
    def leaves(group, before=""):
        for name, command in group.commands.items():
            yield from leaves(command, f"{name} ") if hasattr(command, "commands") else [(before + name, command)]

    options = {name: {each.name for each in found.params} for name, found in leaves(typer.main.get_command(app))}
    writing = {name for name, found in options.items() if found & {"out", "plot", "save", "csv"}}
    # A batch continues an existing store.
    assert writing - {"batch"} == set(WRITING)
    assert {name for name, found in options.items() if "force" in found} == set(WRITING)


def test_it_is_replaced_with_force(fricjax, folder):
    assert fricjax("inspect", RUN, "--plot", "old.png", "--force").code == 0
    assert (folder / "old.png").read_bytes().startswith(b"\x89PNG")


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_without_space_the_numbers_are_told_and_the_old_file_stays(fricjax, folder, monkeypatch):
    words = ("inspect", RUN, "--plot", "old.png", "--force")
    monkeypatch.setattr(files, "_fill", full)
    called = fricjax(*words)
    assert called.code == 5
    assert called.err == (
        "Error: 'old.png' cannot be used: no space left on its disk; nothing was written, and an existing file is "
        "unchanged.\n"
    )
    assert called.out == fricjax("inspect", RUN).out
    as_json = fricjax(*words, "--json")
    report = json.loads(as_json.out)
    assert (as_json.code, as_json.err, report["kind"], report["exit_code"]) == (5, "", "output", 5)
    assert report["error"] == called.err.removeprefix("Error: ").strip()
    assert (report["files"], report["samples"]) == ({}, json.loads(fricjax("inspect", RUN, "--json").out)["samples"])
    assert contents(folder) == dict.fromkeys(OLD, "old")


def test_the_demonstration_names_its_own_file(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_fill", full)
    nothing: demo.Fit = None  # pyright: ignore[reportAssignmentType, reportPrivateImportUsage, reportAttributeAccessIssue]
    with pytest.raises(OSError, match="no space left") as caught:
        demo._write(tmp_path, RUN, RIG, nothing, False)
    assert caught.value.filename == str(tmp_path / "run.csv")


@pytest.mark.parametrize("words", [("inspect", RUN, "--plot", "run.png"), ("demo", "--out", "new/folder")])
def test_a_folder_that_cannot_be_written_to_is_refused_before_any_work(fricjax, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    real = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **more: mode != os.W_OK and real(path, mode, **more))
    called = fricjax(*words)
    assert called.code == 5
    assert "its folder cannot be written to" in called.err
    assert json.loads(fricjax(*words, "--json").out)["kind"] == "output"
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_an_output_that_is_full_is_told_so():
    with open("/dev/full", "w") as out:
        words = [sys.executable, "-c", "from fricjax.cli.main import main; main()", "calibrate", "interferometer"]
        ran = subprocess.run(words, stdout=out, stderr=subprocess.PIPE, text=True)
    assert (ran.returncode, ran.stderr.count("\n")) == (5, 1), ran.stderr
    assert ran.stderr == "Error: 'stdout' cannot be used: No space left on device.\n"


def test_no_space_is_no_fault_of_the_program_wherever_it_shows():
    failure = failure_of(OSError(errno.EDQUOT, "Disk quota exceeded"))
    assert failure.text == "Error: Something cannot be written: Disk quota exceeded. Make room, or write elsewhere."
    assert (failure.kind, failure.exit_code) == ("output", 5)


def test_a_file_that_came_in_between_is_told_in_the_words_of_the_command_line():
    failure = failure_of(files.refused(errno.EEXIST, "fit.json"))
    assert failure.text == "Error: 'fit.json' exists already. Add --force, or give another name."
    assert (failure.kind, failure.exit_code) == ("output", 2)
