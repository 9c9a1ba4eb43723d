"""The page of the command line is generated, complete and well linked."""

import re
import runpy

import pytest
import typer

from fricjax.cli import failure
from fricjax.cli.main import app
from tests.documents import ROOT

GENERATOR = "notebooks/_pages/commands.py"
PAGE = ROOT / "notebooks" / "cli.md"


@pytest.fixture(scope="module")
def page():
    return PAGE.read_text(encoding="utf-8")


def commands(group, before=""):
    """Yield the words and the names of the options of each command."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, f"{before}{name} ")
        if not hasattr(command, "commands") or command.invoke_without_command:
            yield before + name, [word for each in command.params for word in (*each.opts, *each.secondary_opts)]


def test_the_page_is_the_generated_one(page):
    generated = runpy.run_path(str(ROOT / GENERATOR))["page"]()
    assert page == generated, f"the commands have changed: run python {GENERATOR}"


def test_every_command_and_option_is_on_the_page(page):
    found = dict(commands(typer.main.get_command(app)))
    assert {"fit", "models", "models show", "calibrate frf"} <= set(found)
    before, *sections = re.split(r"^## `fricjax (.+)`$", page, flags=re.MULTILINE)
    own = dict(zip(sections[::2], sections[1::2], strict=True))
    assert set(own) == set(found)
    shared = set(re.findall(r"`(--[\w-]+)`", before))
    for name, options in found.items():
        missing = {word for word in options if word.startswith("--")} - shared - set(re.findall(r"--[\w-]+", own[name]))
        assert not missing, (name, missing)


def test_every_exit_code_is_on_the_page(page):
    codes = {failure.DONE, failure.INCOMPLETE, failure.USAGE, failure.INVALID, failure.REJECTED, failure.FAULT}
    codes |= {failure.INTERRUPTED}
    assert codes == set(failure.CODES)
    assert {int(code) for code in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)} == codes


def test_links_of_the_page_lead_to_its_headings(page):
    headings = re.findall(r"^#+ (.+)$", page, re.MULTILINE)
    anchors = {heading.replace("`", "").lower().replace(" ", "-") for heading in headings}
    assert set(re.findall(r"\]\(#([\w-]+)\)", page)) <= anchors
