"""Run the code blocks of README, documentation and CONTRIBUTING, with named exceptions."""

import re
import shlex
import shutil
import tomllib
from pathlib import Path

import pytest

import fricjax as fj
from tests import documents
from tests.cli.conftest import call
from tests.documents import ROOT
from tests.laboratory import RIG, write_files

PAGES = [ROOT / "README.md", *sorted((ROOT / "notebooks").glob("*.md"))]
QUANTITIES = ("Time", "Displacement", "Amplitude", "Velocity", "Speed", "Friction force", "Frequency", "Residual")
LEGIBLE = 8.0
"""Smallest text of a picture in points: 12 pixels where the 7 inches of its width are shown as 800."""

EXCEPTED = {
    "-m venv .venv": "makes an environment; the automatic check runs this line",
    "pip install": "needs the package index",
    "pre-commit install": "changes the checkout's git",
    "-m pytest": "is this run",
    "mkdocs build": "tests/notebooks/test_pages.py builds the documentation",
}
# Commands with a documented exit code other than 0.
CODES = {"fricjax inspect sheet.csv": 4}
# These options start processes, as tests/archive/test_distributed.py does. Here the commands run with --dry-run.
WITH_OTHERS = ("--workers", "--scheduler")


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_the_blocks_of_a_page_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    codes = documents.blocks(path.read_text(), "python")
    ran = documents.run(codes, path.name) if codes else documents.Ran("", [])
    for figure in (value for value in ran.shown if hasattr(value, "savefig")):
        figure.canvas.draw()
        for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
            label, ticks = axis.label.get_text(), axis.get_ticklabels()
            named = [text for text in ticks if re.search("[a-z]{2}", text.get_text().replace("mathdefault", ""))]
            assert label or named or not ticks, "an axis of numbers without a label"
            assert "[" in label or not label.startswith(QUANTITIES), f"the axis '{label}' has no unit"
            assert min(text.get_fontsize() for text in (axis.label, *ticks)) >= LEGIBLE


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Folder with the files that the pages name."""
    folder = tmp_path_factory.mktemp("laboratory")
    write_files(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("path", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda path: path.stem)
def test_the_commands_of_a_page_run(path, laboratory, tmp_path, monkeypatch):
    monkeypatch.chdir(shutil.copytree(laboratory, tmp_path / "here"))
    monkeypatch.setenv("FRICJAX_CACHE_DIR", "off")
    text = path.read_text()
    # A page that calibrates its rig writes this file itself.
    if "--out rig.toml" not in text:
        Path("rig.toml").write_text(RIG)
    for command in documents.commands(text):
        if any(words in command for words in EXCEPTED):
            continue
        program, *words = shlex.split(command)
        assert program == "fricjax", f"{command}: run it, or say in EXCEPTED why not"
        called = call(*words, *(["--dry-run"] if set(words) & set(WITH_OTHERS) else []))
        assert called.code == CODES.get(command, 0), f"{command}\n{called.err}"
        assert "Warning" not in called.err, f"{command}\n{called.err}"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
def test_tables_of_settings_are_read(path, tmp_path):
    for number, text in enumerate(documents.blocks(path.read_text(), "toml")):
        settings = tomllib.loads(text)
        if "mass" in settings:
            rig = tmp_path / f"{number}.toml"
            rig.write_text(text)
            assert fj.Rig.from_toml(rig).mass.value > 0


@pytest.mark.parametrize("path", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda path: path.stem)
def test_what_a_text_names_exists(path):
    text = path.read_text()
    named = re.findall(r"\bpython (experiments/[\w/]+\.py)", " ".join(text.split()))
    linked = re.findall(r"\]\(([\w./]+)(?:#[\w-]+)?\)", text) if path.parent == ROOT else []
    assert not [name for name in [*named, *linked] if not (ROOT / name).exists()]
